"""Effects and honest circumstances are not taken for slips."""

from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.examination import NOT_SLIPS, questioned_by
from tests.marks import slow
from tests.support.gap_campaigns import FOUR, campaign
from tunnel_reference.draw import Mixture
from tunnel_reference.make import as_campaign, draw_set, simulate_set
from tunnel_sim.effects import ALL_EFFECTS, BetweenRuns, Effect
from tunnel_sim.engine.virtual_campaign import simulate_campaign
from tunnel_sim.files.plan_file import paper_plan
from tunnel_sim.vocabulary.plan import EffectSetting

#: Their moments are drawn by the simulator; they are among the drawn campaigns.
_RANDOM = {"ambient_vibration", "buffeting"}
_EFFECTS = [kind for kind in ALL_EFFECTS if not (kind.name in _RANDOM or issubclass(kind, BetweenRuns))]
_SCATTERING = [kind for kind in ALL_EFFECTS if issubclass(kind, BetweenRuns)]


@pytest.mark.parametrize("kind", _EFFECTS, ids=lambda kind: kind.name)
def test_no_effect_is_taken_for_a_slip(kind: type[Effect]):
    assert set(questioned_by(campaign(kind(*kind.example), conditions=FOUR))) <= NOT_SLIPS


@pytest.mark.parametrize("seed", [0, *map(slow, range(1, 4))])
@pytest.mark.parametrize("kind", [_SCATTERING[0], *map(slow, _SCATTERING[1:])], ids=lambda kind: kind.name)
def test_no_scatter_is_taken_for_a_slip(kind: type[Effect], seed: int):
    """Of five times the typical width, which is 1.5 % of the speed and 5 % of the damping, and so of less."""
    info, paper = kind.parameters()[0], paper_plan()
    short = tuple(replace(one, duration=min(one.duration, 5.0)) for one in paper.conditions)
    wide = EffectSetting(kind.name, {info.name: 5.0 * info.scale})
    plan = replace(paper, seed=seed, conditions=short, effects=(wide,))
    assert set(questioned_by(simulate_campaign(plan))) <= NOT_SLIPS


@pytest.mark.slow
@pytest.mark.parametrize("driven", [False, True])
def test_drawn_campaigns_are_not_questioned(driven: bool):
    """Campaigns of the reference simulator, of other scales, with few runs, coloured noise and uneven stamps.

    The target is 1 in 100; the whole count is in decision 0031.
    """
    mixture = Mixture(variety=0.6, driven=driven)
    draws = draw_set(
        16, 31, {"none": 1.0} if driven else {"none": 1.0, "outside": 1.0, "single": 1.0}, mixture
    )
    found = [questioned_by(as_campaign(one, "drawn")) for one in simulate_set(draws)]
    assert all(set(slips) <= NOT_SLIPS for slips in found)
