"""All forms of the known effects; ``p`` is the severity parameter, ``e`` are the secondary parameters."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

import tunnel_reference
from tunnel_reference.catalogue import Form

_MODULES = [
    import_module(f"tunnel_reference.{module.name}")
    for module in iter_modules(tunnel_reference.__path__)
    if module.name.startswith("forms_")
]
FORMS: tuple[Form, ...] = tuple(form for module in _MODULES for form in module.FORMS)
EDITION = max(form.edition for form in FORMS)
"""The latest edition of the catalogue."""


def families(*, driven: bool, edition: int = EDITION) -> tuple[str, ...]:
    """The families of an edition, in the order of the alphabet.

    Args:
        driven: whether to include families that act on driven runs only.
    """
    named = {form.family for form in FORMS if form.edition <= edition and (driven or not form.driven)}
    return tuple(sorted(named))


FAMILIES = families(driven=False)
"""The families of free decays."""
DRIVEN_FAMILIES = families(driven=True)
"""The families of driven runs."""


def forms_of(family: str) -> tuple[Form, ...]:
    """All forms of one family, the textbook form first."""
    return tuple(form for form in FORMS if form.family == family)
