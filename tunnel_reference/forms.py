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
_EVERY: tuple[Form, ...] = tuple(form for module in _MODULES for form in module.FORMS)


def _of_edition(edition: int) -> tuple[Form, ...]:
    """The forms of an edition of the catalogue."""
    return tuple(f for f in _EVERY if f.edition <= edition and (f.until is None or edition <= f.until))


EDITION = max(form.edition for form in _EVERY)
"""The latest edition of the catalogue."""
FORMS = _of_edition(EDITION)


def families(*, driven: bool, edition: int = EDITION) -> tuple[str, ...]:
    """The families of an edition, in the order of the alphabet.

    Args:
        driven: whether to include families that act on driven runs only.
    """
    return tuple(sorted({form.family for form in _of_edition(edition) if driven or not form.driven}))


FAMILIES = families(driven=False)
"""The families of free decays."""


def forms_of(family: str, edition: int = EDITION) -> tuple[Form, ...]:
    """All forms of one family in an edition, the textbook form first."""
    return tuple(form for form in _of_edition(edition) if form.family == family)
