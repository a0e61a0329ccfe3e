"""Every kind of driven campaign: what is identified, what is diagnosed, and what is refused.

The kinds and their truth are in ``tests/support/driven_runs.py``.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import refuse_undiagnosable
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.starting_points import nominal_start
from diagnosis.model.blocks import prepare
from diagnosis.model.parameters import Point
from diagnosis.model.similar import similar_campaign
from diagnosis.noise.sensor_noise import LEAST_SAMPLES, campaign_noise
from diagnosis.settings import Settings
from identification import identify
from identification.estimators import ALL_ESTIMATORS, estimators_of_driven_runs
from identification.uncertainty.cramer_rao import CampaignBound, campaign_bound
from tests.marks import slow
from tests.support.driven_runs import (
    GAIN,
    INERTIA,
    KINDS,
    NOISE,
    TRUTH,
    Planted,
    driven,
    exact,
    with_noise,
)
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import Truth
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

ESTIMATORS = estimators_of_driven_runs()
REFUSED = {
    "frequency_response": {
        name: said
        for name, kind in KINDS.items()
        for applies, said in (
            (
                any(column is None for _, column in kind.runs),
                "is a free decay, which has no frequency response",
            ),
            (kind.runs[0][0] == 0.0, "has no spring, and so no resonance"),
            (not kind.even, "uneven samples, which a Fourier transform does not take"),
        )
        if applies
    },
    "bayesian": {
        name: "no spring, and so no stiffness to find"
        for name, kind in KINDS.items()
        if kind.runs[0][0] == 0.0
    },
}
GAINED = re.compile(r"runs? [r0-9, ]+: the gain of the input is (\S+) ± (\S+) rad/s² per unit(.*);")
QUICK = {"unknown gain", "turning base", "held, rates"}


def pairs() -> list[object]:
    """Output error with every kind, and the other estimators with some; the rest are slow."""
    found = []
    for estimator in ESTIMATORS:
        for name in KINDS:
            quick = estimator == "output_error" or name in QUICK
            if name not in REFUSED.get(estimator, {}):
                found.append((name, estimator) if quick else slow(name, estimator))
    return found


@pytest.mark.parametrize(("name", "estimator"), pairs())
def test_the_rig_is_identified(name: str, estimator: str) -> None:
    kind, found = KINDS[name], identify(driven(name), estimator)
    for quantity, truth in TRUTH.items():
        value = getattr(found, quantity)
        if not kind.stated:
            assert value is None
            continue
        assert abs(value.value - truth) < 4.5 * value.std < 4.5 * 0.003 * truth
    for run, (spring, _) in zip(found.runs, kind.runs, strict=True):
        assert (run.omega_n is None) == (spring == 0.0)
        if run.omega_n is not None:
            assert abs(run.omega_n.value - np.sqrt(spring / INERTIA)) < 4.5 * run.omega_n.std
    said = [found for remark in found.remarks if (found := GAINED.match(str(remark)))]
    assert bool(said) == kind.finds_gain
    for gain, std, unit in (found.groups() for found in said):
        assert abs(float(gain) - GAIN / INERTIA) < 4.5 * float(std)
        assert ("N m per unit" in unit) == kind.stated


@pytest.mark.parametrize(
    ("name", "estimator", "said"),
    [
        *((name, estimator, said) for estimator, rows in REFUSED.items() for name, said in rows.items()),
        *(
            ("moment, then released", name, f"run 'r0': the run is driven, and {name} takes free decays only")
            for name in ALL_ESTIMATORS
            if name not in ESTIMATORS
        ),
    ],
)
def test_what_an_estimator_does_not_take_is_refused_in_one_line(name: str, estimator: str, said: str) -> None:
    with pytest.raises(TunnelError, match=said) as refusal:
        identify(driven(name), estimator)
    assert "\n" not in str(refusal.value)


def bound(given: Campaign) -> CampaignBound:
    truth = Truth(0.0, 0.0, **TRUTH)
    return campaign_bound(given, truth, noise_std=NOISE["angle"], drive_gain=GAIN)


BOUNDED = [name for name, kind in KINDS.items() if kind.stated and kind.reads == "angle"]


@pytest.mark.parametrize("name", BOUNDED)
def test_standard_deviations_are_those_of_the_bound(name: str) -> None:
    least, found = bound(driven(name)), identify(driven(name))
    assert least.parameters == tuple(TRUTH)
    for quantity in TRUTH:
        tolerance = 0.05 if name == "turning base" else 0.1
        assert getattr(found, quantity).std == pytest.approx(least.std(quantity), rel=tolerance)


@pytest.mark.parametrize(
    "name",
    [slow(name) for name in BOUNDED if KINDS[name].even],
)
def test_estimates_scatter_as_the_bound_says(name: str) -> None:
    clean, distances = exact(name), []
    information = np.linalg.inv(np.array(bound(clean).covariance))
    for seed in range(30):
        found = identify(with_noise(clean, 100 + seed))
        error = np.array([getattr(found, quantity).value - truth for quantity, truth in TRUTH.items()])
        distances.append(error @ information @ error)
    # χ² of 60 values: outside this range once in ten thousand
    assert 26.4 < float(np.sum(distances)) < 112.3


def test_a_gain_that_must_be_found_costs_information() -> None:
    assert bound(exact("stated gain")).std("yaw_inertia") < bound(exact("unknown gain")).std("yaw_inertia")


@pytest.mark.parametrize("name", KINDS)
def test_the_noise_is_measured(name: str) -> None:
    given = driven(name)
    found = campaign_noise(given, Settings().noise)
    assert all(
        abs(value / NOISE[given.sensor.quantity] ** 2 - 1.0) < 0.15 for value in found.variance.values()
    )


@pytest.mark.parametrize("name", ["unknown gain", "no spring stated", "moment, then released", "loose"])
def test_the_nominal_model_is_fitted(name: str) -> None:
    given, kind = driven(name), KINDS[name]
    similar, change = similar_campaign(given)
    data = prepare(similar, {run.id: NOISE["angle"] ** 2 for run in similar.runs}, change)
    found = fit(Problem(data), nominal_start(data))
    assert abs(found.excess) < 0.15
    if kind.stated:
        assert change.own(found.value("yaw_inertia"), "kg m2") / INERTIA == pytest.approx(1.0, rel=1e-3)
    if kind.finds_gain:
        truth = GAIN if kind.stated else GAIN / INERTIA
        assert change.own(found.value("drive_gain"), "N m") == pytest.approx(truth, rel=5e-3)
    else:
        assert "drive_gain" not in found.problem.names


def test_a_part_of_a_run_keeps_its_input() -> None:
    similar, change = similar_campaign(driven("unknown gain"))
    data = prepare(similar, {run.id: NOISE["angle"] ** 2 for run in similar.runs}, change)
    found = fit(Problem(data), nominal_start(data))
    later = data.with_runs(tuple(run.part(300) for run in data.runs))
    again = fit(Problem(later), Point(found.point.common, np.zeros_like(found.point.per_run)))
    assert abs(again.excess) < 0.15


LAWS = ("coulomb_friction", "quadratic_damping", "cubic_stiffness", "structural_damping", "input_delay")
MODES = ("second_mode", "cubic_stiffness", "rod_flexibility", "input_delay", "dropped_samples")
DIAGNOSED = {"unknown gain", "turning base", "loose"}


@pytest.mark.parametrize(
    "name",
    [name if name in DIAGNOSED else slow(name) for name in KINDS if name != "loose, root and released"],
)
def test_a_rig_without_an_effect_has_no_gap(name: str) -> None:
    found = diagnose(driven(name), kinds=vocabulary(LAWS))
    assert found.causes == ()
    for quantity, truth in TRUTH.items():
        if quantity in found.coefficients.after:
            value = found.coefficients.after[quantity]
            assert abs(value.value - truth) < 4.0 * (value.std or 0.0)


def test_without_a_mode_none_is_named() -> None:
    assert diagnose(driven("moment"), kinds=vocabulary(MODES)).causes == ()


CUBIC = "cubic_stiffness", Planted(cubic=2.0), {"coefficient": 2.0}
RUBS = "coulomb_friction", Planted(friction=0.01), {"friction_moment": 0.01}
RINGS = (0.02, 2.0 * np.pi * 6.0, 0.02)
MODE = (
    "second_mode",
    Planted(mode=RINGS),
    dict(zip(("amplitude", "frequency", "damping_ratio"), RINGS, strict=True)),
)


@pytest.mark.parametrize(
    ("name", "cause", "planted", "truth"),
    [
        slow("no spring stated", *CUBIC),
        ("root", *CUBIC),
        slow("unknown gain", *CUBIC),
        slow("loose", *RUBS),
        slow("moment", *RUBS),
        slow("rates", *RUBS),
        slow("uneven", *RUBS),
        ("turning base", "coulomb_friction", Planted(friction=0.004), {"friction_moment": 0.004}),
        slow("unknown gain", "input_delay", Planted(delay=0.005), {"delay": 0.005}),
        slow("moment", *MODE),
        slow("unknown gain", *MODE),
    ],
)
def test_what_is_planted_is_named_with_its_size(
    name: str, cause: str, planted: Planted, truth: dict[str, float]
) -> None:
    kinds = vocabulary(MODES if cause == "second_mode" else LAWS)
    found = diagnose(driven(name, planted), kinds=kinds, rivals=())
    assert found.causes == (cause,)
    assert found.gap.closed > 0.95
    parameters = found.candidates[0].parameters
    for key, value in truth.items():
        std = parameters[key].std
        assert std is not None
        assert abs(parameters[key].value - value) < 4.0 * std
    assert found.where.words is not None
    assert "along the decay" not in found.where.words
    assert not any("MuJoCo" in said for said in found.cautions)
    assert any(
        "their loss depends on the motion of the spring's root" in said for said in found.cautions
    ) == (name == "root")


def of_first(**change: Any) -> Callable[[Campaign], Campaign]:
    """The first run with other properties, with those of its drive under ``drive``."""

    def changed(given: Campaign) -> Campaign:
        run = given.runs[0]
        inner = dict(change)
        if isinstance(inner.get("drive"), dict):
            inner["drive"] = replace(run.drive, **inner["drive"])  # type: ignore[type-var]
        return replace(given, runs=(replace(run, **inner), *given.runs[1:]))

    return changed


def alone(change: Callable[[Campaign], Campaign]) -> Callable[[Campaign], Campaign]:
    return lambda given: change(replace(given, runs=given.runs[:1]))


def scaled(factor: float) -> Callable[[Campaign], Campaign]:
    """The input of the first run, alone, times a factor."""

    def changed(given: Campaign) -> Campaign:
        run = given.runs[0]
        assert run.drive is not None
        return of_first(drive={"values": factor * run.drive.values})(replace(given, runs=(run,)))

    return changed


def shortened(given: Campaign) -> Campaign:
    run, size = given.runs[0], LEAST_SAMPLES - 1
    assert run.drive is not None
    record = Record(run.record.time_s[:size], run.record.yaw_rad[:size])
    return of_first(record=record, drive={"values": run.drive.values[:size]})(given)


def reading(quantity: str) -> Callable[[Campaign], Campaign]:
    return lambda given: replace(given, sensor=SensorProperties(100.0, quantity=quantity))  # type: ignore[arg-type]


def without_springs(given: Campaign) -> Campaign:
    return replace(given, runs=tuple(replace(run, spring_stiffness=0.0) for run in given.runs))


def beside(name: str, **change: Any) -> Callable[[Campaign], Campaign]:
    """With a changed run of another campaign."""

    def changed(given: Campaign) -> Campaign:
        other = of_first(**change)(driven(name)).runs[0]
        return replace(given, runs=(*given.runs, replace(other, id="other")))

    return changed


IN_WIND = {"wind_speed": 3.0, "air_density": 1.2}


@pytest.mark.parametrize(
    ("name", "change", "uses", "said"),
    [
        ("root", without_springs, (diagnose,), "but spring_stiffness is 0"),
        ("loose", of_first(drive={"column": "base_rad"}), (identify,), "root acts through the spring"),
        (
            "moment",
            alone(shortened),
            (diagnose,),
            f"driven and has {LEAST_SAMPLES - 1} samples.*{LEAST_SAMPLES} samples or more",
        ),
        ("rates", reading("acceleration"), (identify, diagnose), "reads accelerations"),
        ("rates", without_springs, (identify, diagnose), "looks like a constant moment"),
        ("loose", beside("moment"), (diagnose,), "runs with a spring and without one"),
        (
            "loose",
            beside("loose", **IN_WIND),
            (diagnose,),
            "without a spring are not diagnosed with the wind on",
        ),
        ("loose", beside("loose", drive={"column": "drive"}), (diagnose,), "when the gain is unknown"),
        ("loose", scaled(-1.0), (diagnose,), "does not follow the moment"),
        ("moment", scaled(0.0), (identify, refuse_undiagnosable), "is constant"),
        ("turning base", alone(without_springs), (identify, refuse_undiagnosable), "without a spring"),
        ("turning base", alone(of_first(**IN_WIND)), (identify, refuse_undiagnosable), "with the wind on"),
        ("turning base", scaled(-1.0), (identify, refuse_undiagnosable), "the other sign"),
        ("turning base", scaled(180.0 / np.pi), (identify, refuse_undiagnosable), "in degrees"),
        ("turning base", scaled(np.pi / 180.0), (identify, refuse_undiagnosable), "in radians"),
        (
            "unknown gain",
            beside("moment", drive={"column": "base_acceleration_m_s2"}),
            (identify,),
            "base_acceleration_m_s2 and drive are unknown",
        ),
    ],
)
def test_what_cannot_be_treated_is_refused_in_one_line(
    name: str,
    change: Callable[[Campaign], Campaign],
    uses: tuple[Callable[[Campaign], object], ...],
    said: str,
) -> None:
    given = replace(change(driven(name)), rig=RigProperties(INERTIA, 0.036, 0.625))
    for use in uses:
        with pytest.raises(TunnelError, match=said) as refusal:
            use(given)
        assert "\n" not in str(refusal.value)
