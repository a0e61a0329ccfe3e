"""The reference integrator against closed forms and against an adaptive solver with tight tolerances."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from tests.reference.rigs import rig
from tunnel_reference import moments as m
from tunnel_reference.integrator import BoundLaw, Phase, integrate
from tunnel_reference.true_conditions import REFERENCE_LENGTH, TwistingRod


def closed_form(c, run):
    """Free decay from rest."""
    inertia = c.yaw_inertia
    sigma = (c.mechanical_damping - c.air_damping[run]) / (2 * inertia)
    omega = np.sqrt((c.true_stiffness[run] - c.air_stiffness[run]) / inertia - sigma**2)
    phase = omega * c.time
    return c.start_angle[run] * np.exp(-sigma * c.time) * (np.cos(phase) + sigma / omega * np.sin(phase))


def adaptive(c, run, moment, memory=()):
    """SciPy's solution; ``moment(t, state)`` gives the extra moment and the memory's derivative."""

    def slope(t, y):
        extra, dx = moment(t, y)
        linear = -c.true_stiffness[run] * y[0] - c.mechanical_damping * y[1]
        air = c.air_stiffness[run] * y[0] + c.air_damping[run] * y[1]
        return [y[1], (linear + air + extra) / c.yaw_inertia, *dx]

    start = [c.start_angle[run], 0.0, *memory]
    out = solve_ivp(
        slope, (0, c.time[-1]), start, method="DOP853", t_eval=c.time, rtol=1e-11, atol=1e-13, max_step=0.02
    )
    return out.y[0]


def test_linear_decay_matches_closed_form():
    c = rig()
    (motion,) = integrate([c], [[]], substeps=4)
    for run in range(2):
        assert np.max(np.abs(motion.angle[:, run] - closed_form(c, run))) < 1e-8


def test_order_of_convergence_is_four():
    c = rig(duration=1.0)
    exact = np.stack([closed_form(c, run) for run in range(2)], axis=1)
    coarse = rig(duration=1.0, sample_rate=100.0)
    errors = [np.max(np.abs(integrate([coarse], [[]], substeps=k)[0].angle - exact[::10])) for k in (1, 2, 4)]
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert orders == pytest.approx([4.0, 4.0], abs=0.25)


CASES = {
    "cubic_spring": (
        m.polynomial_spring,
        {"k2": 0.1, "k3": 0.5, "k4": 0.0, "k5": 0.3},
        lambda c, run: (
            lambda _t, y: (
                -c.true_stiffness[run] * (0.1 * y[0] ** 2 + 0.5 * y[0] ** 3 + 0.3 * y[0] ** 5),
                (),
            )
        ),
    ),
    "quadratic_damping": (
        m.quadratic_damping,
        {"coefficient": 0.01},
        lambda _c, _run: lambda _t, y: (-0.01 * abs(y[1]) * y[1], ()),
    ),
    "tanh_friction": (
        m.tanh_friction,
        {"moment": 0.02, "speed": 0.1},
        lambda _c, _run: lambda _t, y: (-0.02 * np.tanh(y[1] / 0.1), ()),
    ),
    "gravity": (
        m.gravity,
        {"stiffness": 0.3, "angle": 0.2, "second": 0.1},
        lambda _c, _run: lambda _t, y: (-0.3 * (np.sin(y[0] - 0.2) + 0.05 * np.sin(2 * (y[0] - 0.2))), ()),
    ),
    "nonlinear_air": (
        m.cubic_air,
        {"kappa": 2.0, "quintic": 1.0},
        lambda c, run: lambda _t, y: (c.air_stiffness[run] * (2.0 * y[0] ** 3 + y[0] ** 5), ()),
    ),
    "air_damping": (
        m.nonlinear_air_damping,
        {"mu": 5.0},
        lambda c, run: lambda _t, y: (c.air_damping[run] * 5.0 * y[0] ** 2 * y[1], ()),
    ),
}


@pytest.fixture(scope="module")
def smooth():
    """The motions of all cases, and the linear one, in one batch."""
    laws = [
        [BoundLaw(law, Phase.MOMENT, {k: np.full(2, v) for k, v in values.items()})]
        for law, values, _ in CASES.values()
    ]
    *motions, linear = integrate([rig(duration=1.0)] * (len(CASES) + 1), [*laws, []], substeps=4)
    return dict(zip(CASES, motions, strict=True)), linear


@pytest.mark.parametrize("name", CASES)
def test_smooth_laws_match_an_adaptive_solver(name, smooth):
    motions, linear = smooth
    c, make = rig(duration=1.0), CASES[name][2]
    assert np.max(np.abs(motions[name].angle - linear.angle)) > 1e-3
    for run in range(2):
        assert np.max(np.abs(motions[name].angle[:, run] - adaptive(c, run, make(c, run)))) < 1e-8


def test_a_law_that_acts_twice_in_a_campaign_adds_up():
    """As where two effects are forms of one polynomial."""
    c = rig(duration=1.0)

    def spring(**values):
        terms = {"k2": 0.0, "k3": 0.0, "k4": 0.0, "k5": 0.0} | values
        return BoundLaw(m.polynomial_spring, Phase.MOMENT, {k: np.full(2, v) for k, v in terms.items()})

    apart, other = integrate([c, c], [[spring(k2=0.1), spring(k3=0.5)], [spring(k3=0.5)]], substeps=4)
    together, alone = integrate([c, c], [[spring(k2=0.1, k3=0.5)], [spring(k3=0.5)]], substeps=4)
    assert np.max(np.abs(apart.angle - together.angle)) < 1e-12
    assert np.array_equal(other.angle, alone.angle)
    assert np.max(np.abs(apart.angle - other.angle)) > 1e-3


@pytest.mark.slow
def test_dead_zone_matches_an_adaptive_solver():
    c = rig()
    half = 0.004
    term = BoundLaw(
        m.dead_zone, Phase.ANGLE, {"half": np.full(2, half), "left": np.zeros(2), "centre": np.zeros(2)}
    )
    (motion,) = integrate([c], [[term]])
    for run in range(2):
        other = adaptive(
            c, run, lambda _t, y, run=run: (c.true_stiffness[run] * np.clip(y[0], -half, half), ())
        )
        assert np.max(np.abs(motion.angle[:, run] - other)) < 1e-6


@pytest.mark.slow
def test_lag_and_speed_drift_match_an_adaptive_solver():
    c = rig(speed=(15.0, 25.0))
    tau = 0.8 * REFERENCE_LENGTH / c.true_speed
    lag = BoundLaw(m.lag_one, Phase.ANGLE, {"w1": np.ones(2), "tau1": tau}, np.tile(c.start_angle, (1, 1)))
    drift = BoundLaw(
        m.speed_drift,
        Phase.WIND,
        {"drift": np.full(2, 0.1), "span": np.full(2, 2.0), "exponent": np.ones(2)},
    )
    (motion,) = integrate([c], [[lag, drift]])
    for run in range(2):

        def extra(t, y, run=run):
            ratio = 1.0 + 0.1 * t / 2.0
            moment = (
                c.air_stiffness[run] * (ratio**2 * y[2] - y[0]) + c.air_damping[run] * (ratio - 1.0) * y[1]
            )
            return moment, ((y[0] - y[2]) / tau[run],)

        other = adaptive(c, run, extra, (c.start_angle[run],))
        assert np.max(np.abs(motion.angle[:, run] - other)) < 1e-8


def test_flexible_rod_matches_the_exponential_of_its_matrix():
    rod = TwistingRod(compliance=1e-3, share=0.15, damping_ratio=0.02)
    c = rig(duration=0.5, rod=rod)
    (motion,) = integrate([c], [[]], substeps=20)
    k, inertia = 1.0 / rod.compliance, c.yaw_inertia
    top, body = rod.share * inertia, (1 - rod.share) * inertia
    damping = 2 * rod.damping_ratio * np.sqrt(k * top)
    for run in range(2):
        matrix = np.array(
            [
                [0, 1, 0, 0],
                [
                    (c.air_stiffness[run] - k) / body,
                    (c.air_damping[run] - damping) / body,
                    k / body,
                    damping / body,
                ],
                [0, 0, 0, 1],
                [
                    k / top,
                    damping / top,
                    -(k + c.true_stiffness[run]) / top,
                    -(damping + c.mechanical_damping) / top,
                ],
            ]
        )
        start = np.array([c.start_angle[run], 0, c.start_angle[run] * k / (k + c.true_stiffness[run]), 0])
        values, vectors = np.linalg.eig(matrix)
        weights = np.linalg.solve(vectors, start.astype(complex))
        exact = np.real((vectors[2] * weights) @ np.exp(values[:, None] * c.time))
        assert np.max(np.abs(motion.angle[:, run] - exact)) < 1e-7


def coulomb_exact(c, run, tc, end):
    """Dry friction and linear damping, half cycle by half cycle in closed form; rest angle when it stops."""
    inertia, k = c.yaw_inertia, c.true_stiffness[run] - c.air_stiffness[run]
    sigma = (c.mechanical_damping - c.air_damping[run]) / (2 * inertia)
    omega = np.sqrt(k / inertia - sigma**2)
    time, angle, out = 0.0, c.start_angle[run], np.empty_like(c.time)
    half = np.pi / omega
    while True:
        if k * abs(angle) <= tc:
            out[c.time >= time - 1e-12] = angle
            return out
        centre = np.sign(angle) * tc / k
        inside = (c.time >= time) & (c.time <= time + half)
        t = c.time[inside] - time
        out[inside] = centre + (angle - centre) * np.exp(-sigma * t) * (
            np.cos(omega * t) + sigma / omega * np.sin(omega * t)
        )
        angle = centre - (angle - centre) * np.exp(-sigma * half)
        time += half
        if time > end:
            return out


@pytest.mark.slow
@pytest.mark.parametrize("tc", [0.004, 0.6])
def test_coulomb_friction_matches_its_closed_form_to_rest(tc):
    c = rig(duration=3.0)
    term = BoundLaw(m.coulomb_level, Phase.FRICTION, {"moment": np.full(2, tc)})
    (motion,) = integrate([c], [[term]])
    for run in range(2):
        assert np.max(np.abs(motion.angle[:, run] - coulomb_exact(c, run, tc, 3.0))) < 1e-8
    if tc > 0.1:
        assert np.all(motion.rate[-1] == 0.0)
        assert np.all(motion.angle[-200:] == motion.angle[-1])


def test_friction_sticks_at_release_and_breaks_loose_under_a_rising_moment():
    c = rig(stiffness=(20.0,), speed=(0.0,), angle=(0.001,), duration=0.5)
    stick = BoundLaw(m.coulomb_level, Phase.FRICTION, {"moment": np.array([0.05])})
    push = BoundLaw(
        m.harmonic_moment,
        Phase.MOMENT,
        {
            "moment": np.array([0.2]),
            "frequency": np.array([0.25]),
            "phase": np.zeros(1),
            "second": np.zeros(1),
        },
    )
    (motion,) = integrate([c], [[stick, push]])
    # Net moment −Kβ + M sin(ωt) passes Tc at M sin = Tc + K β.
    loose = np.arcsin((0.05 + 20.0 * 0.001) / 0.2) / (2 * np.pi * 0.25)
    moved = c.time[np.flatnonzero(motion.angle[:, 0] != 0.001)[0]]
    assert loose < moved < loose + 0.003


def test_energy_is_kept_without_damping_and_falls_by_the_friction_work():
    c = rig(stiffness=(40.0,), speed=(0.0,), angle=(0.3,), mechanical_damping=0.0, duration=1.0)
    (motion,) = integrate([c], [[]], substeps=5)
    energy = 0.5 * 40.0 * motion.angle[:, 0] ** 2 + 0.05 * motion.rate[:, 0] ** 2
    assert np.ptp(energy) / energy[0] < 1e-9
    term = BoundLaw(m.coulomb_level, Phase.FRICTION, {"moment": np.array([0.01])})
    (motion,) = integrate([c], [[term]], substeps=5)
    energy = 0.5 * 40.0 * motion.angle[:, 0] ** 2 + 0.05 * motion.rate[:, 0] ** 2
    path = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(motion.angle[:, 0])))])
    assert np.max(np.abs(energy[0] - energy - 0.01 * path)) < 1e-5


@pytest.mark.slow
def test_a_campaign_moves_the_same_alone_and_in_a_batch():
    first, second = rig(), rig(stiffness=(35.0, 20.0), duration=1.0)
    term = BoundLaw(m.quadratic_damping, Phase.MOMENT, {"coefficient": np.full(2, 0.01)})
    dry = BoundLaw(m.coulomb_level, Phase.FRICTION, {"moment": np.full(2, 0.01)})
    together = integrate([first, second, first], [[term], [], [dry]], substeps=2)
    for number, (c, terms) in enumerate([(first, [term]), (second, []), (first, [dry])]):
        (alone,) = integrate([c], [terms], substeps=2)
        assert np.allclose(together[number].angle, alone.angle, rtol=0, atol=1e-13)


def test_rigid_and_flexible_rods_are_not_mixed():
    with pytest.raises(ValueError, match="one kind of rod"):
        integrate([rig(), rig(rod=TwistingRod(1e-4))], [[], []])
