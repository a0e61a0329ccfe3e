"""The constraints of the oldest environment are the floors of ``pyproject.toml``. Truth: PyPA's own parser."""

from __future__ import annotations

from packaging.requirements import Requirement

from tests.oldest import oldest


def test_every_dependency_names_its_oldest_version() -> None:
    pairs = [(Requirement(given), Requirement(constraint)) for given, constraint in oldest()]
    assert {"numpy", "h5py", "nicegui", "dask", "pytest", "stable-baselines3"} <= {
        own.name for own, _ in pairs
    }
    for given, constraint in pairs:
        (pin,) = constraint.specifier
        assert (constraint.name, constraint.extras, pin.operator) == (given.name, set(), "==")
        assert given.specifier.contains(pin.version)
        (floor,) = (one for one in given.specifier if one.operator in (">=", "=="))
        assert floor.version.removesuffix(".*") == pin.version
