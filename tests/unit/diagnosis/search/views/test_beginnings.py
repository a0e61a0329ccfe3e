"""Runs with a long input: their causes are found in their beginnings and fitted to whole runs."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from diagnosis import Settings
from diagnosis.search.investigate import investigate
from diagnosis.search.study import Study
from diagnosis.search.views.beginnings import AfterBeginnings, Beginnings, beginnings, common_length
from diagnosis.search.views.whole_runs import WholeRuns
from tests.support.driven_runs import COUNT, Planted, driven
from tests.support.gap_campaigns import FOUR, campaign, nominal
from tests.unit.diagnosis.test_driven_lost_samples import COUNT as COUNT_LOST
from tests.unit.diagnosis.test_driven_lost_samples import LOST, SHARES
from tests.unit.diagnosis.test_driven_lost_samples import campaign as with_lost_samples
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

SPRING = Planted(cubic=-2.0)
VIEWS = Beginnings, AfterBeginnings, WholeRuns


def cut_to(readings: int) -> Settings:
    """Longer driven runs are cut to so many readings."""
    return Settings().changed({"search.long_input": readings, "search.begun_on": readings})


@cache
def study(share: float, names: tuple[str, ...], lost: bool = False) -> Study:
    """Two driven runs whose sets grow on a share of the readings."""
    data: Campaign = with_lost_samples(kept=False) if lost else driven("moment", SPRING)
    count = 2 * (COUNT_LOST if lost else COUNT)
    settings = cut_to(round(share * count))
    kinds = [effect_class(name) for name in names]
    return investigate(data, kinds, settings=settings, views=VIEWS, rivals=())


def lengths(found: Study, *names: str) -> list[int]:
    answer = found.of(names)
    assert answer is not None
    assert answer.hypothesis is not None
    return [run.reading.size for run in answer.hypothesis.fit.problem.data.runs]


def test_driven_runs_have_beginnings_of_a_common_length_and_others_stay_whole() -> None:
    data = nominal(driven("moment, then released")).problem.data
    longer, free = data.runs
    size = longer.reading.size
    runs = (longer.part(last=100), longer, free, longer)
    limited = replace(data.with_runs(runs), settings=cut_to(size + 701))
    assert common_length(limited) == 300
    found = beginnings(limited, 300).runs
    assert [run.reading.size for run in found] == [100, 300, size, 300]
    assert np.array_equal(found[1].reading, longer.reading[:300])
    all_of_it = replace(limited, settings=cut_to(100 + 3 * size))
    assert common_length(all_of_it) == size
    assert beginnings(all_of_it, size).runs == runs
    of_free_alone = replace(limited, settings=cut_to(size))
    assert common_length(of_free_alone) == 0


def test_a_cause_is_found_in_the_beginnings_and_fitted_to_whole_runs() -> None:
    names = "cubic_stiffness", "coulomb_friction", "quadratic_damping"
    found = study(0.5, names)
    assert found.causes == ("cubic_stiffness",)
    whole = [run.reading.size for run in found.nominal.problem.data.runs]
    assert lengths(found, "cubic_stiffness") == whole
    assert found.of(["coulomb_friction"]) is None  # unlikely in the beginnings
    of_whole = study(1.0, names)
    assert lengths(of_whole, "coulomb_friction") == whole
    name = "cubic_stiffness.coefficient"
    std = of_whole.chosen.std(name)
    assert found.chosen.value(name) == pytest.approx(of_whole.chosen.value(name), abs=0.1 * std)
    assert found.chosen.std(name) == pytest.approx(std, rel=0.02)


@pytest.mark.parametrize("share", [0.38, 0.5], ids=["in no beginning", "in the beginning of one run"])
def test_what_acts_later_on_is_found_in_whole_runs(share: float) -> None:
    assert SHARES[0] > 0.38  # of the run until samples are lost
    assert SHARES[0] < 0.5 < SHARES[1]
    found = study(share, ("dropped_samples", "input_delay", "cubic_stiffness"), lost=True)
    assert found.causes == ("dropped_samples",)
    whole = [run.reading.size for run in found.nominal.problem.data.runs]
    assert lengths(found, "dropped_samples") == whole
    assert found.chosen.excess < 0.2
    lost = found.similarity.own(found.chosen.value("dropped_samples.lost_time"), "s")
    assert lost == pytest.approx(LOST, rel=0.02)


@pytest.mark.slow
def test_what_acts_later_on_is_found_beside_what_acts_from_the_beginning() -> None:
    """Both runs lose five samples after five eighths of their length."""
    lost, runs = slice(5 * COUNT // 8, 5 * COUNT // 8 + 5), []
    for run in driven("moment", SPRING).runs:
        assert run.drive is not None
        yaw, drive = np.delete(run.record.yaw_rad, lost), np.delete(run.drive.values, lost)
        record = Record(run.record.time_s[: yaw.size], yaw)
        runs.append(replace(run, record=record, drive=replace(run.drive, values=drive)))
    data = replace(driven("moment", SPRING), runs=tuple(runs))
    kinds = [effect_class(name) for name in ("cubic_stiffness", "dropped_samples")]
    settings = cut_to(COUNT)
    in_beginnings = investigate(data, kinds, settings=settings, views=(Beginnings,), rivals=())
    assert in_beginnings.causes == ("cubic_stiffness",)
    found = investigate(data, kinds, settings=settings, views=VIEWS, rivals=())
    assert found.causes == ("cubic_stiffness", "dropped_samples")


def test_whole_runs_decide_where_the_runs_differ_by_chance() -> None:
    deviations, runs = np.random.default_rng(5), []
    for seed in range(2):
        for run in driven("moment", SPRING, seed).runs:
            assert run.spring_stiffness is not None
            stated = run.spring_stiffness * (1.0 + 0.004 * deviations.standard_normal())
            runs.append(replace(run, id=f"{run.id}-{seed}", spring_stiffness=stated))
    data = replace(driven("moment", SPRING), runs=tuple(runs))
    kinds = [effect_class(name) for name in ("cubic_stiffness", "coulomb_friction", "stiffness_scatter")]
    settings = cut_to(2 * COUNT)
    found = investigate(data, kinds, settings=settings, views=VIEWS, rivals=())
    assert found.causes == ("cubic_stiffness", "stiffness_scatter")
    assert lengths(found, "coulomb_friction") == [run.reading.size for run in found.nominal.problem.data.runs]


@pytest.mark.parametrize("share", [1.0, 0.2], ids=["within the limit", "with beginnings of a few cycles"])
def test_other_driven_runs_are_viewed_whole(share: float) -> None:
    settings = cut_to(round(share * 2 * COUNT))
    with pytest.raises(ValueError, match="no view of the runs applies"):
        investigate(driven("moment", SPRING), settings=settings, views=(Beginnings,))


def test_free_decays_are_viewed_whole() -> None:
    settings = cut_to(3000)
    cause = effect_from("quadratic_damping", {"coefficient": 0.003})
    with pytest.raises(ValueError, match="no view of the runs applies"):
        investigate(campaign(cause, conditions=FOUR), (), settings=settings, views=(Beginnings,))
