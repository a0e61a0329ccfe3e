"""A view of the runs of one's own, in this file: sets of causes are found in the first halves of the runs."""

from dataclasses import dataclass, replace

import pytest

from diagnosis.likelihood.least_squares import fit, try_fit
from diagnosis.likelihood.problem import Problem
from diagnosis.search.investigate import investigate
from diagnosis.search.views.view import View
from tests.support.gap_campaigns import campaign
from tunnel_sim.effects import effect_class, effect_from

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

NAMES = ("quadratic_damping", "coulomb_friction", "cubic_stiffness")


@dataclass(frozen=True, eq=False)
class FirstHalves(View):
    """The first half of every run."""

    @classmethod
    def after(cls, prepared, known, clock):
        del clock
        if known is not None:
            return None
        data = prepared.nominal.problem.data
        halves = data.with_runs(tuple(run.part(0, run.reading.size // 2) for run in data.runs))
        return cls(prepared, fit(Problem(halves), prepared.nominal.point))

    def whole(self, hypothesis):
        problem = replace(hypothesis.fit.problem, data=self.prepared.nominal.problem.data)
        fitted = try_fit(problem, hypothesis.fit.point)
        return None if fitted is None else replace(hypothesis, fit=fitted)


def test_a_view_of_ones_own_finds_the_cause_and_fits_it_to_whole_runs():
    data = campaign(effect_from("quadratic_damping", {"coefficient": 0.003}), duration=8.0)
    steps = []
    found = investigate(data, [effect_class(name) for name in NAMES], steps.append, views=(FirstHalves,))
    assert found.causes == ("quadratic_damping",)
    assert found.chosen.problem.data is found.nominal.problem.data
    assert abs(found.chosen.excess) < 0.1
    other = found.of(["coulomb_friction"]).hypothesis.fit
    assert max(run.fine.reading.size for run in other.problem.data.runs) == 1000  # as it was weighed
    assert len(steps) - len(set(steps)) == 0
    assert {"effects", "pruning", "polishing", "choices"} <= set(found.seconds)
