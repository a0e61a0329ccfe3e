"""The help of `tunnel identify` lists the registry, whatever is in it."""

from identification.estimators import SUMMARIES
from tunnel_lab.commands import identify


def test_help_lists_every_estimator_with_its_summary(tunnel):
    _, out, _ = tunnel("identify", "--help")
    assert identify.ESTIMATORS not in out
    text = " ".join(out.split())
    for name, summary in SUMMARIES.items():
        assert f"{name} {summary.split()[0]}" in text
