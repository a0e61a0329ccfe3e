"""All forms of the known effects; ``p`` is the severity parameter, ``e`` are the secondary parameters."""

from __future__ import annotations

from tunnel_reference.catalogue import Form
from tunnel_reference.forms_air import AIR_FORMS
from tunnel_reference.forms_mechanical import MECHANICAL_FORMS
from tunnel_reference.forms_sensor import SENSOR_FORMS

FORMS: tuple[Form, ...] = (*MECHANICAL_FORMS, *AIR_FORMS, *SENSOR_FORMS)
FAMILIES: tuple[str, ...] = tuple(sorted({form.family for form in FORMS}))


def forms_of(family: str) -> tuple[Form, ...]:
    """All forms of one family, the textbook form first."""
    return tuple(form for form in FORMS if form.family == family)
