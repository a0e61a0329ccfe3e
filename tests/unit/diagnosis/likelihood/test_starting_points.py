"""Where fits start: the nominal model from the records, an effect's severity from its signature."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.likelihood.least_squares import fit, fit_at
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import residual_spectra, resonance, wind_line
from diagnosis.likelihood.starting_points import misses_motion, nominal_start, project_out, starting_points
from diagnosis.model.blocks import prepare
from diagnosis.model.joint import Joint
from diagnosis.model.parameters import Point
from diagnosis.model.run_noise import WhiteNoise
from tests.reference import free_decays
from tests.reference.free_decays import SIX, Setting, Truth
from tests.support.gap_campaigns import CN_BETA, INERTIA, campaign, nominal
from tunnel_sim.effects import ALL_EFFECTS, effect_class, effect_from
from tunnel_sim.effects.evidence import Sought
from tunnel_sim.effects.parameters import Trial
from tunnel_sim.vocabulary.rig import JointLaw, Term

NOISE = 4e-4


def prepared(settings=SIX, duration=6.0):
    data = free_decays.campaign(
        settings, noise=NOISE, rate=250.0, duration=duration, rng=np.random.default_rng(2)
    )
    return prepare(data, {run.id: NOISE**2 for run in data.runs})


def test_the_nominal_start_is_within_a_fifth_of_a_radian_of_phase():
    """Close enough for Gauss–Newton: half a percent of frequency is 0.2 rad after 6 s at 1 Hz."""
    truth = Truth()
    start = nominal_start(prepared())
    inertia, damping, cn_beta, cn_r, zero = start.common
    assert inertia == pytest.approx(truth.yaw_inertia, rel=5e-3)
    assert cn_beta == pytest.approx(truth.cn_beta, abs=0.05)
    assert (damping > 0.0, cn_r) == (True, 0.0)
    assert zero == pytest.approx(0.004, abs=0.004)
    np.testing.assert_allclose(start.per_run[:, 0], 0.35, atol=0.01)


def test_the_nominal_start_of_runs_without_wind_or_stiffness():
    still = nominal_start(prepared(SIX[:1] + SIX[3:4]))
    assert still.common.size == 3
    assert still.common[0] == pytest.approx(Truth().yaw_inertia, rel=5e-3)
    normalised = nominal_start(prepared((Setting(None, 0.0), Setting(None, 0.0, 0.2))))
    assert normalised.common[0] == pytest.approx(16.12 / Truth().yaw_inertia, rel=5e-3)


@pytest.mark.parametrize(("cubic", "square"), [(60.0, 0.0), (-30.0, 0.0), (0.0, 20.0)])
def test_the_nominal_start_sees_the_stiffness_of_a_joints_law_at_the_amplitude(cubic, square):
    """Harmonic balance: K + ¾ c A² of c b³, and K + 8/(3π) q A of q b |b|."""
    inertia, amplitude, data = 0.11, 0.3, prepared((Setting(16.12, 0.0), Setting(44.84, 0.0)))
    runs = []
    for run in data.runs:
        seen = run.spring_stiffness + 0.75 * cubic * amplitude**2 + 8.0 / (3.0 * np.pi) * square * amplitude
        time = run.interval * np.arange(run.reading.size)
        runs.append(replace(run, reading=amplitude * np.cos(np.sqrt(seen / inertia) * time)))
    terms = (Term("b^3", cubic, "N m/rad3"), Term("b*abs(b)", square, "N m/rad2"))
    law = JointLaw(inertia, 16.12, terms=terms)
    data = replace(data.with_runs(tuple(runs)), model=Joint(law=law))
    start, names = nominal_start(data), Problem(data).names
    assert start.common[names.index("yaw_inertia")] == pytest.approx(inertia, rel=0.01)


def test_a_free_form_starts_at_the_textbook_value_or_inside_its_bounds():
    for info in (info for kind in ALL_EFFECTS for info in kind.parameters() if info.form):
        start = info.default + (0.5 * info.scale if info.default == info.lower else 0.0)
        assert info.lower < start < info.upper


def test_nothing_that_the_fit_can_absorb_is_left_of_a_change():
    base = nominal(campaign())
    rng = np.random.default_rng(3)
    weights = rng.normal(size=len(base.point.common))
    own = rng.normal(size=base.point.per_run.shape)
    columns = [c @ weights + r @ o for (c, r), o in zip(base.jacobian, own, strict=True)]
    size = np.sqrt(sum(float(c @ c) for c in columns))
    assert np.sqrt(sum(float(c @ c) for c in project_out(base, columns))) < 1e-6 * size


LINEAR = {
    "quadratic_damping": {"coefficient": 4e-4},
    "cubic_stiffness": {"coefficient": 0.01},
    "asymmetric_stiffness": {"coefficient": 0.02},
    "nonlinear_yaw_moment": {"coefficient": 0.15},
    "flow_misalignment": {"angle": 0.005},
    "sensor_drift": {"drift": 1e-3},
    "wind_speed_offset": {"offset": 0.05},
    "unsteady_aero_lag": {"lag": 0.2},
}


@pytest.mark.parametrize("name", LINEAR)
def test_the_predicted_drop_of_a_small_effect_is_the_drop_it_brings(name):
    values = LINEAR[name]
    base = nominal(campaign(effect_from(name, values)))
    lead = starting_points(base, effect_class(name))[0]
    found = fit(lead.problem, lead.point, base=base)
    assert lead.predicted_drop == pytest.approx(base.total - found.total, rel=0.15)
    key = f"{name}.{next(iter(values))}"
    severity = lead.point.common[lead.problem.names.index(key)]
    assert severity == pytest.approx(next(iter(values.values())), rel=0.25)
    assert abs(found.value(key) - next(iter(values.values()))) < 4.0 * found.std(key)


def test_a_lag_moves_no_other_parameter_beyond_its_bounds():
    """What they absorb grows with the lag, beyond where friction would be negative."""
    base = nominal(campaign(effect_from("unsteady_aero_lag", {"lag": -1.0})))
    start = starting_points(base, effect_class("coulomb_friction"))[0]
    common = start.point.common.copy()
    common[start.problem.names.index("coulomb_friction.friction_moment")] = 1e-3
    beside = fit_at(start.problem, replace(start.point, common=common))
    found = starting_points(beside, effect_class("unsteady_aero_lag"))
    assert found
    for one in found:
        lower, upper = one.problem.bounds
        assert np.all((lower <= one.point.common) & (one.point.common <= upper))


def test_what_these_runs_cannot_show_has_no_lead():
    still = campaign()
    still = replace(still, runs=tuple(run for run in still.runs if not run.wind_on))
    base = nominal(still)
    assert starting_points(base, effect_class("nonlinear_yaw_moment")) == []
    assert starting_points(base, effect_class("vortex_shedding")) == []
    assert starting_points(base, effect_class("coulomb_friction"))
    one_spring = replace(still, runs=still.runs[:1])
    assert starting_points(nominal(one_spring), effect_class("spring_miscalibration")) == []


def test_leads_come_the_most_promising_first():
    base = nominal(campaign(effect_from("rod_flexibility", {"compliance": 5e-5, "inertia_share": 0.2})))
    drops = [start.predicted_drop for start in starting_points(base, effect_class("rod_flexibility"))]
    assert drops == sorted(drops, reverse=True)
    assert len(drops) == 3


def test_a_wrong_spring_is_sought_among_the_springs_there_are():
    base = nominal(
        campaign(effect_from("spring_miscalibration", {"error": 0.002, "spring_stiffness": 44.84}))
    )
    held = {dict(lead.problem.fixed)["spring_miscalibration.spring_stiffness"] for lead in
            starting_points(base, effect_class("spring_miscalibration"))}  # fmt: skip
    assert held == {16.12, 44.84}


def test_an_offset_of_the_wind_speed_starts_with_wind_left():
    """Linear theory asks for more than the slowest wind; without wind there is no derivative to fit."""
    base = nominal(campaign(effect_from("wind_speed_offset", {"offset": -13.0})))
    (lead,) = starting_points(base, effect_class("wind_speed_offset"))
    slowest = min(run.wind_speed for run in base.problem.data.runs if run.wind_on)
    assert lead.point.common[lead.scaled] == pytest.approx(-0.5 * slowest)


def test_a_nearer_start_has_less_of_the_effect_and_nothing_else_changed():
    base = nominal(campaign(effect_from("quadratic_damping", {"coefficient": 0.003})))
    (lead,) = starting_points(base, effect_class("quadratic_damping"))
    near = lead.nearer()
    assert near.problem is lead.problem
    assert near.point.common[:-1] == pytest.approx(lead.point.common[:-1])
    assert 0.0 < near.point.common[-1] < 0.1 * lead.point.common[-1]
    clipped = starting_points(base, effect_class("sensor_clipping"))[0]
    assert clipped.nearer() is None


def readings_of(data, effect, common, own, noise=0.0):
    """The same runs with the readings of a model."""
    values = [getattr(effect, info.name) for info in effect.parameters() if not (info.form or info.of_input)]
    point = Point(np.array([*common, *values]), np.array(own))
    readings = Problem(data, (type(effect),)).predict([point])[0]
    rng = np.random.default_rng(7)
    runs = tuple(
        replace(
            run,
            reading=y + rng.normal(0.0, noise, y.size) / np.sqrt(run.block),
            noise=WhiteNoise(NOISE**2 / run.block),
        )
        for run, y in zip(data.runs, readings, strict=True)
    )
    return replace(data, runs=runs)


NOMINAL = (INERTIA, 0.008, CN_BETA, -0.25, 0.001)


def test_a_shedding_line_gives_its_strouhal_number_amplitude_and_phase():
    shed = effect_from("vortex_shedding", {"amplitude": 0.01, "strouhal_number": 0.16})
    phases = np.linspace(0.3, 5.8, 6)
    own = [[0.35, 0.0, phase] for phase in phases]
    data = readings_of(replace(prepared(duration=10.0), width=0.225), shed, NOMINAL, own, NOISE)
    base = fit(Problem(data), nominal_start(data))
    line = wind_line(base, 0.02, 0.60, "width")
    assert line is not None
    assert line.parameter == pytest.approx(0.16, abs=0.002)
    assert line.amplitude == pytest.approx(0.01, rel=0.15)
    lead = starting_points(base, effect_class("vortex_shedding"))[0]
    found = fit(lead.problem, lead.point, base=base)
    assert abs(found.excess) < 5.0 * np.sqrt(2.0 / found.count)
    windy = [i for i, run in enumerate(data.runs) if run.wind_on]
    turn = found.point.per_run[windy, 2] - phases[windy]
    np.testing.assert_allclose(np.angle(np.exp(1j * turn)), 0.0, atol=0.3)


def test_what_the_damping_leaves_at_the_bodys_own_frequency_is_not_a_shedding_line():
    """In one wind-on run a line of any frequency has a Strouhal number, and the own one is the stronger here.

    The record is long enough for 8 % of the frequency to be ten times its resolution.
    """
    shed = effect_from("vortex_shedding", {"amplitude": 0.008, "strouhal_number": 0.16})
    damping = effect_from("quadratic_damping", {"coefficient": 5e-4})
    data = campaign(damping, shed, duration=40.0)
    base = nominal(replace(data, runs=data.runs[3:5]))
    own, spectrum = resonance(base, 1), residual_spectra(base)[1]
    assert spectrum.power(own) > 5.0 * spectrum.power(0.16 * 15.0 / 0.225)
    assert wind_line(base, 0.02, 0.60, "width").parameter == pytest.approx(0.16, abs=0.002)


def test_a_shedding_line_follows_the_wind_speed_that_the_fit_has_corrected():
    shed = effect_from("vortex_shedding", {"amplitude": 0.02, "strouhal_number": 0.19})
    offset = effect_from("wind_speed_offset", {"offset": -1.5})
    base = nominal(campaign(shed, offset))
    (start,) = starting_points(base, type(offset))
    corrected = fit(start.problem, start.point, base=base)
    lead = starting_points(corrected, type(shed))[0]
    found = fit(lead.problem, lead.point, base=corrected)
    assert abs(found.excess) < 5.0 * np.sqrt(2.0 / found.count)
    assert found.value("vortex_shedding.strouhal_number") == pytest.approx(0.19, rel=1e-3)


def test_a_sine_in_the_residuals_has_its_amplitude_in_their_spectrum():
    base = nominal(campaign(duration=10.0))
    time = base.problem.data.runs[0].interval * np.arange(base.residuals[0].size)
    sine = replace(base, residuals=[3.0 * np.sin(2.0 * np.pi * 7.3 * time + 0.4) for _ in base.residuals])
    spectrum = residual_spectra(sine)[0]
    assert abs(spectrum.at(7.3)) == pytest.approx(3.0, rel=0.01)
    assert np.angle(spectrum.at(7.3)) + np.pi / 2 == pytest.approx(0.4, abs=0.02)
    assert spectrum.power(7.3) == pytest.approx(np.sum(sine.residuals[0] ** 2), rel=0.02)


def test_resonance_is_the_undamped_frequency_with_the_air():
    base = nominal(campaign())
    for i, run in enumerate(base.problem.data.runs):
        pressure = 0.5 * run.air_density * run.wind_speed**2 * 0.036 * 0.625
        expected = np.sqrt((run.spring_stiffness - pressure * CN_BETA) / INERTIA) / (2.0 * np.pi)
        assert resonance(base, i) == pytest.approx(expected, rel=1e-3)


def test_a_gross_misfit_is_distinguished_from_a_small_one():
    assert not misses_motion(nominal(campaign(effect_from("quadratic_damping", {"coefficient": 0.003}))))
    assert misses_motion(nominal(campaign(effect_from("coulomb_friction", {"friction_moment": 0.3}))))


def test_an_effect_that_would_have_to_be_larger_than_it_may_is_not_tried(monkeypatch):
    """The readings of an arm that turns over the top are beyond what a sensor's centre may be."""
    clipping, base = effect_class("sensor_clipping"), nominal(campaign())
    assert starting_points(base, clipping)
    far = Trial({"limit": 3.6, "centre": 6.4}, None)
    monkeypatch.setattr(clipping, "trials", lambda _: (far,))
    assert starting_points(base, clipping) == []


def test_an_effect_of_size_zero_is_no_start(monkeypatch):
    base, kind = nominal(campaign()), effect_class("dropped_samples")
    instants = np.full((len(base.problem.data.runs), 1), 0.5)
    for lost, count in ((0.02, 1), (-0.02, 0)):  # a search may find a time below the least one, zero
        found = Sought((lost,), instants, 100.0)
        monkeypatch.setattr(kind, "sought", classmethod(lambda _cls, _residuals, found=found: (found,)))
        assert len(starting_points(base, kind)) == count


@pytest.mark.parametrize("angle", [1e7, 1e308, np.inf])
def test_a_start_beyond_any_motion_has_no_prediction(angle: float):
    """A fit may try one; a rod would be released at an angle that is no number."""
    base = nominal(campaign())
    release = base.point.per_run.copy()
    release[0, 0] = angle
    rod = starting_points(base, effect_class("rod_flexibility"))[0]
    first, second, *_ = rod.problem.predict([Point(rod.point.common, release)])[0]
    assert np.all(np.isinf(first))
    assert np.all(np.isfinite(second))
