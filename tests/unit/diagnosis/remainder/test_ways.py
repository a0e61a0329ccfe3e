"""In which way laws of what remains are sought. Truth: what each way is for, by hand."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from diagnosis.findings.cautions import CAUTIONS
from diagnosis.remainder.ways import AnyLaw, ListedLaws, NotSought, way_for


@pytest.mark.parametrize(
    ("driven", "restored", "kind"),
    [(False, True, AnyLaw), (True, True, ListedLaws), (True, False, NotSought)],
)
def test_the_way_follows_from_how_the_runs_are_excited_and_held(
    driven: bool, restored: bool, kind: type
) -> None:
    study = SimpleNamespace(campaign=SimpleNamespace(driven=driven), model=SimpleNamespace(restored=restored))
    way = way_for(cast("Any", study))
    assert type(way) is kind
    assert (way.caution in CAUTIONS) == (kind is NotSought)
    if kind is NotSought:
        assert way.closable(cast("Any", study), significant=True, decided=True) is None
