"""What a study answers when it is asked for a cause: the better of two explanations by the same effects."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from diagnosis.answer.held_out import excess_base
from diagnosis.noise.mains import Hum
from diagnosis.search import investigate as investigation
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.investigate import _noise_explains, _polished, _weighed
from diagnosis.search.random_moments import RandomAnswer
from diagnosis.search.weigh import UNKNOWN, FittedSet, Weighed
from diagnosis.settings import Settings
from tests.unit.gap_campaigns import campaign, nominal, studied
from tunnel_sim.effects import effect_class, effect_from

if TYPE_CHECKING:
    from diagnosis.likelihood.least_squares import Fit
    from diagnosis.search.study import Study


def left(share: float) -> FittedSet:
    return FittedSet(("vortex_shedding",), share, np.zeros(6))


def _with_excess(fitted: Fit, excess: float) -> Fit:
    return replace(fitted, chi2=fitted.chi2 / fitted.chi2.sum() * (1.0 + excess) * fitted.count)


@pytest.fixture(scope="module")
def study() -> Study:
    """The nominal fit's excess is 1, and a fit with vortex shedding leaves half of it."""
    data = campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))
    base = nominal(data)
    found = studied(data, _with_excess(base, 1.0))
    steady = _with_excess(base, 0.5)
    return replace(found, hypotheses=(Hypothesis(("vortex_shedding",), steady),))


@pytest.mark.parametrize(("share", "is_random"), [(0.4, True), (0.6, False)])
def test_a_random_moment_answers_where_it_leaves_less_than_the_steady_one(
    study: Study, share: float, is_random: bool
) -> None:
    moment = RandomAnswer((effect_class("vortex_shedding"),), None, None, left(share))  # type: ignore[arg-type]
    asked = replace(study, random=(moment,)).random_answer(("vortex_shedding",))
    assert (asked is moment) == is_random


@pytest.mark.parametrize("random", [False, True])
def test_the_answer_is_polished_unless_a_random_moment_gives_it(
    study: Study, monkeypatch: pytest.MonkeyPatch, random: bool
) -> None:
    polished = replace(study.hypotheses[0], textbook=study.nominal)
    monkeypatch.setattr("diagnosis.search.investigate.polish", lambda _: polished)
    moment = RandomAnswer((effect_class("vortex_shedding"),), None, None, left(0.4))  # type: ignore[arg-type]
    found = _polished(study.hypotheses, Weighed(("vortex_shedding",), 0.5, 0.9), (moment,) if random else ())
    assert found == (study.hypotheses if random else (polished,))


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
    noise = replace(study.noise, variance={"r1": 0.5 * LEVEL, "r2": 1.5 * LEVEL}, stated_variance=stated)
    sensor = replace(study.campaign.sensor, resolution=resolution)
    asked = replace(
        study,
        noise=noise,
        campaign=replace(study.campaign, sensor=sensor),
        coarse=coarse,
        step=step,
        test=replace(study.test, noisy=noisy),
        hum=Hum(50.0, 1e-4, 1e-6, None, 0.2),
    )
    found = excess_base(asked)
    assert found.variance == pytest.approx(base)
    assert found.variance * (1.0 + found.extra) == pytest.approx(max(LEVEL, base))
    assert found.hum * found.variance == pytest.approx(0.2 * LEVEL)
    assert excess_base(replace(asked, hum=None)).hum == 0.0


def _left(excess: float, block: int, chance: float = 0.01, **given: object) -> Study:
    """A study whose nominal fit leaves an excess in noise variances of a sample, of readings in blocks."""
    data = SimpleNamespace(runs=(SimpleNamespace(block=block),), mean_block=block)
    fitted = SimpleNamespace(excess=excess * block, chance=chance, problem=SimpleNamespace(data=data))
    noise = SimpleNamespace(variance={"r1": 0.5 * LEVEL, "r2": 1.5 * LEVEL})
    found = {"nominal": fitted, "noise": noise, "coarse": False, "step": 0.0, "hum": None}
    return SimpleNamespace(settings=Settings(), **(found | given))  # type: ignore[return-value]


OPEN = [Weighed(UNKNOWN, 0.0, 0.5), Weighed(("dropped_samples",), 0.3, 0.5)]


@pytest.mark.parametrize(("chance", "explains"), [(0.9, False), (1.1, True)])
def test_a_gap_below_the_scatter_of_the_noise_has_no_shares(chance: float, explains: bool) -> None:
    """Bands may show a gap where the mean square does not; every set would close all of it."""
    left = _left(0.002, 4, chance, test=SimpleNamespace(noisy=False))
    assert _noise_explains(left, [Weighed(("sensor_drift",), 0.0, 0.9)]) is explains


@pytest.mark.parametrize("block", [1, 4])
@pytest.mark.parametrize(
    ("excess", "noisy", "explains"), [(0.9, True, True), (1.1, True, False), (0.1, False, False)]
)
def test_noise_that_misbehaves_explains_a_gap_up_to_its_own_power(
    block: int, excess: float, noisy: bool, explains: bool
) -> None:
    left = _left(excess, block, test=SimpleNamespace(noisy=noisy))
    assert _noise_explains(left, OPEN) is explains
    assert not _noise_explains(left, [*OPEN, Weighed(("dropped_samples",), 0.02, 0.9)])


@pytest.mark.parametrize(("share", "alone"), [(0.5, True), (20.0, False)])
def test_a_hum_is_the_only_cause_where_little_more_is_left_than_it_leaves_by_itself(
    study: Study, share: float, alone: bool
) -> None:
    """Truth: white residuals that hold a multiple of the share of a hum's power that no pure line removes."""
    hum = Hum(50.0, 1e-3, 1e-5, None, 20.0)
    rng = np.random.default_rng(4)
    excess = share * Settings().weighing.hum_left * hum.excess
    residuals = [np.sqrt(1.0 + excess) * rng.normal(size=r.size) for r in study.nominal.residuals]
    base = replace(study.nominal, residuals=residuals)
    found = _weighed(replace(study, hum=hum, hypotheses=()), base)
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

    def grown(base, *_):
        raise LookupError(base.name)

    monkeypatch.setattr(investigation, "by_moment", lambda fit: fit)
    monkeypatch.setattr(investigation, "Problem", lambda data: data)
    monkeypatch.setattr(investigation, "fit", fitted)
    monkeypatch.setattr(investigation, "grow", grown)
    nominal = SimpleNamespace(problem=SimpleNamespace(data=None), point=None)
    sets = {(name,): SimpleNamespace(fit=name) for name in powers}
    found = SimpleNamespace(nominal=nominal, hypothesis=sets.get, settings=Settings())
    weighed = [Weighed((name,), 0.1, 0.01) for name in dict.fromkeys((first, "a", "b"))]
    weighed = weighed if first == "unknown" else [replace(one, probability=0.3) for one in weighed]
    clock = investigation._Clock(None)
    if taken is None:
        assert investigation._weigh_by_moment(found, weighed, [], clock) is None
    else:
        with pytest.raises(LookupError, match=taken):
            investigation._weigh_by_moment(found, weighed, [], clock)
