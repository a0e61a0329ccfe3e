"""The help of `tunnel identify` lists the registry, whatever is in it."""

import pytest

from identification.estimators import SUMMARIES
from tunnel_lab.commands import identify


def test_help_lists_every_estimator_with_its_summary(tunnel):
    _, out, _ = tunnel("identify", "--help")
    assert identify.ESTIMATORS not in out
    text = " ".join(out.split())
    for name, summary in SUMMARIES.items():
        assert f"{name} {summary.split()[0]}" in text


def test_a_new_entry_appears_by_itself(monkeypatch: pytest.MonkeyPatch):
    late = {"latecomer": "an estimator that came late " + 9 * "and goes on "}
    monkeypatch.setattr("tunnel_lab.commands.identify.SUMMARIES", SUMMARIES | late)
    lines = identify.with_estimators(f"Help.\n\nEstimators\n{identify.ESTIMATORS}").splitlines()
    assert any(line.split()[:2] == ["latecomer", "an"] for line in lines)
    assert max(map(len, lines)) <= 78
