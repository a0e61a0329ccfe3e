"""Runs in stretches: their boundaries, and the fits that grow from them."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.likelihood.least_squares import FitError, fit
from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from diagnosis.model.similarity import REFERENCE_FREQUENCY
from diagnosis.search.grow import grow
from diagnosis.search.prepared import fit_nominal
from diagnosis.search.views.stretches import InStretches, fit_longer, in_stretches, long_stretch, spread_out
from tests.support.gap_campaigns import CN_BETA, INERTIA, INTERVAL, campaign, nominal, whole_runs
from tunnel_sim.effects import ALL_EFFECTS, effect_class


@pytest.fixture(scope="module")
def data():
    return nominal(campaign(duration=10.0)).problem.data


def test_stretches_hold_every_block_once(data):
    found = in_stretches(data)
    assert found.length == round(2.0 / (REFERENCE_FREQUENCY * INTERVAL))
    for number, run in enumerate(data.runs):
        own = [part for part, place in zip(found.data.runs, found.places, strict=True) if place[0] == number]
        np.testing.assert_array_equal(np.concatenate([part.reading for part in own]), run.reading)
        assert all(0.5 <= part.reading.size / found.length <= 1.5 for part in own)
        begins = [place[1] for place in found.places if place[0] == number]
        assert [round(part.start / INTERVAL) for part in own] == begins
    assert len({part.id for part in found.data.runs}) == len(found.places)


@pytest.mark.parametrize("factor", [2, 3, 9])
def test_longer_stretches_begin_where_shorter_ones_do(data, factor):
    short = in_stretches(data)
    longer = in_stretches(data, short.length * factor)
    assert set(longer.places) <= set(short.places)
    assert len(longer.places) < len(short.places)


def test_sets_are_compared_over_eighteen_cycles(data):
    short = in_stretches(data)
    assert long_stretch(short) * INTERVAL * REFERENCE_FREQUENCY == pytest.approx(18.0)


@pytest.mark.parametrize(
    "kind", [kind for kind in ALL_EFFECTS if kind.autonomous], ids=lambda kind: kind.name
)
def test_a_stretch_moves_as_it_does_alone(kind, data):
    """Stretches in equal conditions share a moment law, and nothing else."""
    stretches = in_stretches(data, 230).data.runs[::7]
    release = np.array([[0.05 * (k + 1), 0.2 - 0.1 * k] for k in range(len(stretches))])
    common = [0.11, 0.05, *(0.01 * (k + 1) for k in range(30))]

    forms = tuple(f"{kind.name}.{info.name}" for info in kind.parameters() if info.form)

    def predicted(runs, release):
        problem = Problem(data.with_runs(tuple(runs)), (kind,), free_forms=forms)
        within = np.clip(common[: len(problem.names)], *problem.bounds)
        return problem.predict([Point(within, release)])[0]

    together = predicted(stretches, release)
    assert len({run.reading.size for run in stretches}) > 1
    for k, run in enumerate(stretches):
        np.testing.assert_array_equal(together[k], predicted([run], release[k : k + 1])[0])


def test_of_many_stretches_every_second_long_one_is_used(data, monkeypatch):
    monkeypatch.setattr(
        "diagnosis.search.views.stretches._LONG", 6
    )  # these runs are shorter than two of eighteen
    short = in_stretches(data)
    assert spread_out(short, data).places == short.places
    sizes = [run.reading.size for run in data.runs]
    fewer = data.settings.changed({"search.grown_on": sum(sizes) - 1})
    found, long = spread_out(short, replace(data, settings=fewer)), long_stretch(short)
    assert {place[0] for place in found.places if place[1] == 0} == set(range(len(sizes)))
    last = {number: max(1, round(size / long)) - 1 for number, size in enumerate(sizes)}
    expected = [place for place in short.places if min(place[1] // long, last[place[0]]) % 2 == 0]
    assert list(found.places) == expected
    assert 0 < len(expected) < len(short.places)


def test_whole_runs_are_fitted_from_some_of_their_stretches(data, monkeypatch):
    monkeypatch.setattr("diagnosis.search.views.stretches._LONG", 6)
    data = replace(data, settings=data.settings.changed({"search.grown_on": 1000}))
    short = spread_out(in_stretches(data), data)
    found, longest = fit_longer(fit_nominal(short.data), short, data)
    assert longest.data is data
    assert found.excess == pytest.approx(fit_nominal(data).excess, rel=1e-3, abs=1e-3)


def test_releases_are_taken_over_from_shorter_stretches(data, monkeypatch):
    """Where a stretch goes on into the next one, the release of the first one remains."""
    short = in_stretches(data)
    first = fit_nominal(short.data)
    starts = []

    def watched(problem, start, **how):
        starts.append((problem.data, start))
        return fit(problem, start, **how)

    monkeypatch.setattr("diagnosis.search.views.stretches.fit", watched)
    found, longest = fit_longer(first, short, data)
    sizes = [max(run.reading.size for run in runs.runs) for runs, _ in starts]
    assert sizes == sorted(sizes)
    assert longest.data is data
    known = dict(zip(short.places, first.point.per_run, strict=True))
    begins = in_stretches(data, 3 * short.length).places
    np.testing.assert_array_equal(starts[0][1].per_run, [known[place] for place in begins])
    assert [run.id for run in found.problem.data.runs] == [run.id for run in data.runs]


def test_fits_of_growing_length_reach_a_truth_far_out_of_phase(data):
    """A twentieth of the inertia is a whole cycle at the end of the record, from which no fit returns."""
    short = in_stretches(data)
    right = fit_nominal(short.data)
    far = right.point.common.copy()
    far[0] *= 1.05
    begun = fit(Problem(short.data), Point(far, right.point.per_run))
    found, _ = fit_longer(begun, short, data)
    assert abs(found.value("yaw_inertia") - INERTIA) < 4.0 * found.std("yaw_inertia")
    assert abs(found.value("cn_beta") - CN_BETA) < 4.0 * found.std("cn_beta")
    assert abs(found.excess) < 5.0 * np.sqrt(2.0 / found.count)


def test_only_effects_without_a_memory_of_the_release_are_tried_on_stretches(data):
    kinds = [effect_class(name) for name in ("sensor_drift", "second_mode", "quadratic_damping")]
    steps = []
    view = stretched(data, kinds)
    found = grow(view, steps.append)
    assert set(steps) == {"quadratic_damping"}
    assert all(h.fit.problem.data is not data for h in found)
    assert view.whole(found[0]).fit.problem.data is data


def stretched(data, kinds):
    return InStretches.of(whole_runs(fit_nominal(data), kinds).prepared)


def test_a_nominal_model_that_runs_away_on_long_stretches_stays_on_short_ones(data, monkeypatch):
    def away(*_, **__):
        raise FitError

    monkeypatch.setattr("diagnosis.search.views.stretches.fit_longer", away)
    view = stretched(data, [effect_class("quadratic_damping")])
    assert grow(view) == []
    assert max(run.reading.size for run in view.base.problem.data.runs) == in_stretches(data).length
