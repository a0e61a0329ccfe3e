"""All forms of the known effects; ``p`` is the severity parameter, ``e`` are the secondary parameters."""

from __future__ import annotations

from importlib import import_module
from pkgutil import iter_modules

import tunnel_reference
from tunnel_reference.catalogue import NOT_DRIVEN, Form


def _found() -> tuple[Form, ...]:
    """``FORMS`` of every module of this package whose name begins with ``forms_``."""
    names = [module.name for module in iter_modules(tunnel_reference.__path__)]
    modules = [import_module(f"tunnel_reference.{name}") for name in names if name.startswith("forms_")]
    return tuple(form for module in modules for form in module.FORMS)


FORMS: tuple[Form, ...] = _found()
FAMILIES: tuple[str, ...] = tuple(sorted({form.family for form in FORMS if not form.driven}))
DRIVEN_FAMILIES: tuple[str, ...] = tuple(sorted({form.family for form in FORMS} - NOT_DRIVEN))
"""Of driven runs."""


def forms_of(family: str) -> tuple[Form, ...]:
    """All forms of one family, the textbook form first."""
    return tuple(form for form in FORMS if form.family == family)
