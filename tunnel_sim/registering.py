"""Registration of the environments in a process that imports Gymnasium and this package, in any order.

Gymnasium does not search installed packages for environments; for a name without its module it only says that
the namespace is not found. Importing Gymnasium here would slow every command.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from importlib.machinery import ModuleSpec, PathFinder
from types import ModuleType

_REGISTRATION = "gymnasium.envs.registration"


class _Finder:
    """Finds Gymnasium's module of registration, and adds the environments once it is loaded."""

    def find_spec(
        self, name: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if name != _REGISTRATION:
            return None
        sys.meta_path.remove(self)
        spec = PathFinder.find_spec(name, path, target)
        if spec is not None and spec.loader is not None:
            loader = spec.loader
            load = loader.exec_module

            def load_and_register(module: ModuleType) -> None:
                load(module)
                import_module("tunnel_sim.envs")

            loader.exec_module = load_and_register  # type: ignore[method-assign]
        return spec


def register_with_gymnasium() -> None:
    """Register the environments now if Gymnasium is loaded, else when it is."""
    if _REGISTRATION in sys.modules:
        import_module("tunnel_sim.envs")
    else:
        sys.meta_path.insert(0, _Finder())
