"""Marks of parametrised cases."""

from __future__ import annotations

import pytest


def slow(*values: object) -> object:
    """A case that only ``-m slow`` runs: the others of its test claim the same at less cost."""
    return pytest.param(*values, marks=pytest.mark.slow)
