"""What a study answers when it is asked for a cause: the better of two explanations by the same effects."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from diagnosis.answer.held_out import excess_base
from diagnosis.noise.gap import GapTest
from diagnosis.noise.mains import Hum
from diagnosis.search.answer import UNKNOWN, Answer
from diagnosis.search.clock import StepClock
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.prepared import HUM_LEFT
from diagnosis.search.process_noise import MomentLayer
from diagnosis.search.sets import Sets, resolved
from diagnosis.search.study import Study, noise_explains
from diagnosis.search.views import by_moment as moments
from diagnosis.search.views.whole_runs import WholeRuns
from diagnosis.search.weights import FittedSet
from diagnosis.settings import Settings
from tests.support.gap_campaigns import campaign, nominal, studied
from tunnel_sim.effects import effect_class, effect_from

if TYPE_CHECKING:
    from diagnosis.likelihood.least_squares import Fit


def left(share: float) -> FittedSet:
    return FittedSet(("vortex_shedding",), share, np.zeros(6))


def _with_excess(fitted: Fit, excess: float) -> Fit:
    return replace(fitted, chi2=fitted.chi2 / fitted.chi2.sum() * (1.0 + excess) * fitted.count)


@pytest.fixture(scope="module")
def study() -> Study:
    """The nominal fit's excess is 1."""
    data = campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))
    return studied(data, _with_excess(nominal(data), 1.0))


def weighed(study: Study, moment: Hypothesis | None = None) -> Sets:
    """A fit with vortex shedding leaves half of the gap."""
    steady = Hypothesis(("vortex_shedding",), _with_excess(study.nominal, 0.5))
    view = WholeRuns(study.prepared, study.nominal)
    return Sets(view, (steady,), () if moment is None else (moment,), confirmed=steady)


def shedding(share: float) -> Hypothesis:
    layer = MomentLayer((effect_class("vortex_shedding"),), None, left(share))  # type: ignore[arg-type]
    return Hypothesis((), None, moment=layer)  # type: ignore[arg-type]


@pytest.mark.parametrize(("share", "is_random"), [(0.4, True), (0.6, False)])
def test_a_random_moment_answers_where_it_leaves_less_than_the_steady_one(
    study: Study, share: float, is_random: bool
) -> None:
    moment = shedding(share)
    sets = weighed(study, moment)
    asked = sets.at_random(("vortex_shedding",), sets.hypotheses[0])
    assert (asked is moment) == is_random


@pytest.mark.parametrize("random", [False, True])
def test_the_answer_is_polished_unless_a_random_moment_gives_it(
    study: Study, monkeypatch: pytest.MonkeyPatch, random: bool
) -> None:
    sets = weighed(study, shedding(0.4) if random else None)
    vars(sets)["weighed"] = [Answer(("vortex_shedding",), 0.5, 0.9)]
    polished = replace(sets.hypotheses[0], textbook=study.nominal)
    monkeypatch.setattr("diagnosis.search.views.whole_runs.polish", lambda _: polished)
    found = sets.in_whole_runs()[("vortex_shedding",)]
    assert found is (sets.hypotheses[0] if random else polished)


def test_an_answer_that_is_read_off_the_records_is_settled_without_a_fit(study: Study) -> None:
    """It is no set of effects, so that nothing is fitted to whole runs, in no view."""
    sets = weighed(study)
    vars(sets)["weighed"] = [Answer((), 1.0, 0.9), Answer(("vortex_shedding",), 0.5, 0.1)]
    assert resolved(sets) is sets


LEVEL = 1e-6  # rad², the records' own variance


@pytest.mark.parametrize(
    ("stated", "coarse", "noisy", "step", "resolution", "base"),
    [
        (0.5e-6, False, False, 0.0, None, LEVEL),  # the statement is not needed
        (0.5e-6, False, True, 0.0, None, 0.5e-6),
        (0.5e-6, True, False, 3e-3, None, 0.5e-6),
        (1.25e-6, False, True, 0.0, None, 1.25e-6),
        (None, False, True, 0.0, None, LEVEL),
        (None, True, False, 3e-3, None, 0.25e-6),  # without the step's 3²/12 = 0.75
        (None, True, False, 3e-3, 1.2e-3, 0.37e-6),  # with the stated resolution's 1.2²/12 = 0.12 instead
        (None, True, False, 4e-3, None, 0.05e-6),  # the step's 1.33 is more than all: a twentieth is left
    ],
)
def test_an_excess_is_measured_against_the_noise_of_a_perfect_model(
    study: Study, stated: float | None, coarse: bool, noisy: bool, step: float, resolution: float | None,
    base: float,
) -> None:  # fmt: skip
    """In every case base, extra and hum add up to what the records contain, unless the statement is above them."""
    prepared = study.prepared
    noise = replace(prepared.noise, variance={"r1": 0.5 * LEVEL, "r2": 1.5 * LEVEL}, stated_variance=stated)
    sensor = replace(study.campaign.sensor, resolution=resolution)
    changed = replace(
        prepared,
        noise=noise,
        campaign=replace(study.campaign, sensor=sensor),
        coarse=coarse,
        step=step,
        hum=Hum(50.0, 1e-4, 1e-6, None, 0.2),
    )
    gap = replace(study.gap, test=replace(study.gap.test, noisy=noisy))
    asked = replace(study, prepared=changed, gap=gap)
    found = excess_base(asked)
    assert found.variance == pytest.approx(base)
    assert found.variance * (1.0 + found.extra) == pytest.approx(max(LEVEL, base))
    assert found.hum * found.variance == pytest.approx(0.2 * LEVEL)
    assert excess_base(replace(asked, prepared=replace(changed, hum=None))).hum == 0.0


def _left(excess: float, block: int, chance: float = 0.01) -> Fit:
    """A nominal fit that leaves an excess in noise variances of a sample, of readings in blocks."""
    problem = SimpleNamespace(data=SimpleNamespace(mean_block=block))
    return SimpleNamespace(excess=excess * block, chance=chance, problem=problem, settings=Settings())  # type: ignore[return-value]


def judged(noisy: bool) -> GapTest:
    return GapTest(True, 0.0, {}, noisy=noisy)


OPEN = [Answer(UNKNOWN, 0.0, 0.5), Answer(("dropped_samples",), 0.3, 0.5)]


@pytest.mark.parametrize(("chance", "explains"), [(0.9, False), (1.1, True)])
def test_a_gap_below_the_scatter_of_the_noise_has_no_shares(chance: float, explains: bool) -> None:
    """Bands may show a gap where the mean square does not; every set would close all of it."""
    left = _left(0.002, 4, chance)
    assert noise_explains(left, judged(noisy=False), [Answer(("sensor_drift",), 0.0, 0.9)]) is explains


@pytest.mark.parametrize("block", [1, 4])
@pytest.mark.parametrize(
    ("excess", "noisy", "explains"), [(0.9, True, True), (1.1, True, False), (0.1, False, False)]
)
def test_noise_that_misbehaves_explains_a_gap_up_to_its_own_power(
    block: int, excess: float, noisy: bool, explains: bool
) -> None:
    left, test = _left(excess, block), judged(noisy)
    assert noise_explains(left, test, OPEN) is explains
    assert not noise_explains(left, test, [*OPEN, Answer(("dropped_samples",), 0.02, 0.9)])


@pytest.mark.parametrize(("share", "alone"), [(0.5, True), (20.0, False)])
def test_a_hum_is_the_only_cause_where_little_more_is_left_than_it_leaves_by_itself(
    study: Study, share: float, alone: bool
) -> None:
    """Truth: white residuals that hold a multiple of the share of a hum's power that no pure line removes."""
    hum = Hum(50.0, 1e-3, 1e-5, None, 20.0)
    rng = np.random.default_rng(4)
    excess = share * HUM_LEFT * hum.excess
    residuals = [np.sqrt(1.0 + excess) * rng.normal(size=r.size) for r in study.nominal.residuals]
    base = replace(study.nominal, residuals=residuals)
    found = Sets(WholeRuns(replace(study.prepared, hum=hum), base), ()).weighed
    assert found[0].effects == (() if alone else UNKNOWN)


@pytest.mark.parametrize(
    ("first", "powers", "taken"),
    [
        ("a", {"a": 40.0, "b": 0.1}, "b"),  # the first leaves more than the nominal model misses
        ("a", {"a": 0.1, "b": 0.05}, "a"),
        ("a", {"a": 40.0, "b": 9.0}, "a"),  # it explains the angle
        ("unknown", {"a": 40.0, "b": 9.0}, None),
        ("unknown", {"a": 0.1, "b": 9.0}, "a"),
    ],
)
def test_the_random_moment_of_a_free_body_is_that_of_the_likeliest_set_that_leaves_little(
    monkeypatch, first, powers, taken
):
    """The power that each set leaves is given over that which the nominal model misses."""

    def fitted(problem, _):
        return SimpleNamespace(name=problem, excess=1.0 / powers[problem] - 1.0)

    monkeypatch.setattr(moments, "by_moment", lambda fit: fit)
    monkeypatch.setattr(moments, "Problem", lambda data: data)
    monkeypatch.setattr(moments, "fit", fitted)
    data = SimpleNamespace(model=SimpleNamespace(restored=False))
    nominal = SimpleNamespace(problem=SimpleNamespace(data=data), point=None)
    prepared = SimpleNamespace(nominal=nominal, settings=Settings())
    sets = {(name,): SimpleNamespace(fit=name) for name in powers}
    weighed = [Answer((name,), 0.1, 0.01) for name in dict.fromkeys((first, "a", "b"))]
    weighed = weighed if first == "unknown" else [replace(one, probability=0.3) for one in weighed]
    best = SimpleNamespace(fit=SimpleNamespace(chance=0.01))
    known = SimpleNamespace(
        view=SimpleNamespace(prepared=prepared), best=best, fitted=sets.get, weighed=weighed
    )
    view = moments.ByMoment.after(prepared, known, StepClock())
    assert (None if view is None else view.base.name) == taken
