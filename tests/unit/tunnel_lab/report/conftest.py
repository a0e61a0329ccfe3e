"""The diagnosis that is written by hand, for each test to change."""

from __future__ import annotations

from typing import Any

import pytest

from tests.support.diagnosis_document import document


@pytest.fixture
def given() -> dict[str, Any]:
    return document()
