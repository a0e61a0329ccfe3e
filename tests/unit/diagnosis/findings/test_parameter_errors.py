"""Parameters of free forms with the errors that an answer names.

Truth: free decays with dry friction, integrated by SciPy from reversal to reversal, independent of the fits.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import Diagnosis, diagnose, vocabulary
from diagnosis.answer.held_out import excess_base, one_more
from diagnosis.answer.linear_theory import coefficient_move, move_of_halves, parameter_shift
from diagnosis.answer.sizes_by_run import sizes, study_sizes
from diagnosis.findings.candidates import candidates, parameter_errors
from diagnosis.findings.closing import closing
from tests.support.gap_campaigns import answer, campaign, nominal, studied
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Array, Record

CAUSE = "quadratic_damping"
INERTIA, STIFFNESS, DAMPING = 0.1, 16.12, 0.01
KINDS = vocabulary(["coulomb_friction", "quadratic_damping", "structural_damping"])

Friction = Callable[[float], float]
"""The friction (N m) at a rate (rad/s)."""


def stribeck(size: float, peak: float, peak_rate: float) -> Friction:
    return lambda rate: size * (1.0 + peak * np.exp(-((rate / peak_rate) ** 2)))


def sublinear(size: float, exponent: float) -> Friction:
    return lambda rate: size * (rate / 2.0) ** exponent


def saturating(size: float, rate_of_rise: float) -> Friction:
    return lambda rate: size * np.tanh(rate / rate_of_rise)


def swing(friction: Friction, release: float, time: Array) -> Array:
    """A decay from rest, rad, from reversal to reversal until the friction at rest holds the body."""
    found, angle, now = np.full(time.size, release), release, 0.0
    while abs(STIFFNESS * angle) > friction(0.0) and now <= time[-1]:
        way, begun = -np.sign(angle), now

        def slope(_: float, y: Array, way: float = way) -> list[float]:
            moment = -STIFFNESS * y[0] - DAMPING * y[1] - way * friction(abs(y[1]))
            return [y[1], moment / INERTIA]

        def stops(at: float, y: Array, way: float = way, begun: float = begun) -> float:
            return y[1] * way if at > begun + 1e-6 else 1.0

        stops.terminal, stops.direction = True, -1.0  # type: ignore[attr-defined]
        span, start = (now, time[-1] + 1.0), [angle, 0.0]
        part = solve_ivp(
            slope, span, start, rtol=1e-10, atol=1e-12, events=stops, dense_output=True, max_step=0.02
        )
        inside = (time >= now) & (time <= part.t[-1])
        found[inside] = part.sol(time[inside])[0]
        now, angle = float(part.t[-1]), float(part.y[0, -1])
        found[time > now] = angle
    return found


def rubbing(
    friction: Friction, releases: tuple[float, ...], noise: float, seed: int, rate: float
) -> Campaign:
    time = np.arange(0.0, 10.0, 1.0 / rate)
    runs = []
    for place, release in enumerate(releases):
        added = np.random.default_rng([seed, place]).normal(0.0, noise, time.size)
        record = Record(time, swing(friction, release, time) + added)
        runs.append(Run(f"r{place}", record, 0.0, STIFFNESS, release_angle=release))
    return Campaign("rubs", RigProperties(), SensorProperties(rate), tuple(runs))


def errors(found: Diagnosis, truth: dict[str, float]) -> dict[str, float]:
    """Errors of the parameters over their stated standard deviations."""
    assert found.causes == ("coulomb_friction",)
    given = found.candidates[0].parameters
    assert given.keys() == truth.keys()  # the form is the planted one
    return {name: (given[name].value - value) / given[name].std for name, value in truth.items()}


def test_the_form_is_found_where_the_wrong_one_leaves_no_more_than_the_noise():
    """Constant friction leaves χ² 582 of 500 readings, the planted law 420."""
    size, rise = 0.02022405452312456, 0.2541128870464713
    data = rubbing(saturating(size, rise), (0.35,), 1.9994478717260255e-05, 8, 200.0)
    answered = diagnose(data, kinds=KINDS)
    found = errors(answered, {"friction_moment": size, "saturation": rise})
    assert max(map(abs, found.values())) < 3.0
    words = " ".join(answered.cautions)
    assert "Not determined: one release amplitude" in words
    assert "the saturation of coulomb friction may be wrong" in words


LAWS = {
    "stribeck": (stribeck, ("friction_moment", "peak", "peak_rate"), ((0.02, 0.06), (0.4, 1.6), (0.08, 0.3))),
    "sublinear": (sublinear, ("friction_moment", "exponent"), ((0.03, 0.1), (0.12, 0.5))),
    "saturating": (saturating, ("friction_moment", "saturation"), ((0.02, 0.08), (0.03, 0.3))),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_the_errors_of_planted_laws_are_those_stated(law):
    make, names, ranges = LAWS[law]
    rng, found = np.random.default_rng(40), []
    for seed in range(8):
        values = [float(rng.uniform(*one)) for one in ranges]
        noise, releases = 10.0 ** rng.uniform(-5.0, -3.5), ((0.35, 0.2), (0.3, 0.15, 0.1))[seed % 2]
        data = rubbing(make(*values), releases, noise, seed, 100.0 * (1 + seed % 2))
        answered = diagnose(data, kinds=KINDS)
        found.append(list(errors(answered, dict(zip(names, values, strict=True))).values()))
    rms = np.sqrt(np.mean(np.square(found)))
    assert 0.5 < rms < 2.0


def test_a_change_of_the_readings_by_a_parameter_is_its_own_shift(base):
    place = base.problem.names.index("mechanical_damping")
    change = 0.1 * base.std("mechanical_damping")
    found = parameter_shift(base, [common[:, place] * change for common, _ in base.jacobian])
    assert found == pytest.approx(change * np.eye(found.size)[place], abs=1e-6 * change)


def test_the_move_of_a_coefficient_is_that_of_its_gradient(base):
    place = base.problem.names.index("cn_r")
    whole = move_of_halves(base, np.eye(len(base.problem.names))[place])
    assert whole == pytest.approx(coefficient_move(base, "cn_r"))
    assert whole > 0.0  # the cause is missing


def test_a_size_on_which_the_runs_differ_has_more_than_the_error_of_noise():
    """One spring of six is cubic by twice as much, so no one size is right."""
    one, two = (
        campaign(effect_from("cubic_stiffness", {"coefficient": size}), duration=6.0) for size in (0.3, 0.6)
    )
    data = replace(one, runs=(*one.runs[:2], two.runs[2], *one.runs[3:]))
    base = nominal(data)
    best = one_more(base, effect_class("cubic_stiffness"))
    study = studied(data, base, ("cubic_stiffness",), best)
    study = replace(study, answers=(answer(("cubic_stiffness",), 0.0, 1.0, best),))
    name = "cubic_stiffness.coefficient"
    (own,) = sizes(best, study.prepared.kinds)
    assert (
        parameter_errors(study, closing(study), study_sizes(study))[name]
        >= own.form_std
        > 10.0 * best.std(name)
    )


def test_a_named_disagreement_of_the_integrators_is_part_of_the_deviation(data, base):
    best = one_more(base, effect_class(CAUSE))
    study = studied(data, base, (CAUSE,), best)
    study = replace(study, answers=(answer((CAUSE,), 0.0, 1.0, best),))
    agrees, name = closing(study), f"{CAUSE}.coefficient"
    place, plain = best.problem.names.index(name), parameter_errors(study, agrees, study_sizes(study))
    assert plain[name] == pytest.approx(0.0, abs=best.std(name))
    apart = replace(
        agrees,
        confirmation=replace(agrees.confirmation, agrees=False),
        shifts={
            run.id: common[:, place] * 5.0 * best.std(name)
            for run, (common, _) in zip(best.problem.data.runs, best.jacobian, strict=True)
        },
    )
    found = parameter_errors(study, apart, study_sizes(study))
    assert found[name] == pytest.approx(np.hypot(5.0 * best.std(name), plain[name]))
    stds = [
        candidates(study, excess_base(study), given)[0].parameters["coefficient"].std
        for given in (plain, found)
    ]
    assert stds[1] == pytest.approx(np.hypot(stds[0], 5.0 * best.std(name)), rel=0.05)
