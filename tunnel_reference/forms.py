"""The catalogue of forms of the vocabulary's families; ``p`` is the severity parameter, ``e`` the rest."""

from __future__ import annotations

from tunnel_reference.catalogue import Form
from tunnel_reference.forms_air import AIR_FORMS
from tunnel_reference.forms_mechanical import MECHANICAL_FORMS
from tunnel_reference.forms_sensor import SENSOR_FORMS

FORMS: tuple[Form, ...] = (*MECHANICAL_FORMS, *AIR_FORMS, *SENSOR_FORMS)
FAMILIES: tuple[str, ...] = tuple(sorted({form.family for form in FORMS}))


def forms_of(family: str) -> tuple[Form, ...]:
    """All forms of one family, the textbook's first."""
    return tuple(form for form in FORMS if form.family == family)
