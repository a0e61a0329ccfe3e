"""Windows of a few cycles: flat for a linear rig, drifting for one that is not, ending with the signal."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import lfilter

from identification import Status, identify
from identification.datasets import measured_campaign
from identification.estimators.output_error import OutputError
from identification.signal.run_fit import identify_run
from tests.reference.free_decays import Setting, campaign, with_records
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("unexamined")

SETTING = (Setting(16.12, 0.0),)


def test_linear_windows_agree_with_each_other_and_their_deviations():
    data = campaign(SETTING, noise=5e-4, duration=20.0, rng=np.random.default_rng(9))
    run = identify(data).runs[0]
    assert len(run.windows) >= 10
    for name in ("zeta", "omega_n"):
        whole = getattr(run, name).value
        scores = [(getattr(w, name).value - whole) / getattr(w, name).std for w in run.windows]
        # χ² of the windows about the run: beyond these once in 1e4.
        assert 0.05 < np.mean(np.square(scores)) < 3.2
        assert np.max(np.abs(scores)) < 4.5
    for before, after in zip(run.windows[:-1], run.windows[1:], strict=True):
        assert after.start_s == pytest.approx(before.start_s + before.duration_s, abs=1e-9)
        ratio = after.amplitude.value / before.amplitude.value
        assert ratio == pytest.approx(np.exp(-2.0 * np.pi * 3 * run.zeta.value), rel=0.01)


def test_amplitude_is_that_of_mid_window():
    run = identify(campaign(SETTING)).runs[0]
    for window in run.windows:
        middle = window.start_s + 0.5 * window.duration_s
        decay = run.zeta.value * run.omega_n.value
        expected = 0.35 * np.exp(-decay * middle) / np.sqrt(1.0 - run.zeta.value**2)
        assert window.amplitude.value == pytest.approx(expected, rel=2e-3)


def test_windows_stop_where_the_oscillation_sinks_into_the_noise():
    quiet = campaign(SETTING, duration=120.0, rate=200.0, noise=5e-4, rng=np.random.default_rng(1))
    windows = identify(quiet).runs[0].windows
    assert windows
    assert windows[-1].start_s < 110.0
    assert all(window.amplitude.std < 0.06 * window.amplitude.value for window in windows)


def nonlinear(friction, quadratic, cubic):
    def motion(_, state):
        angle, rate = state
        drag = friction * np.tanh(rate / 1e-4) + quadratic * abs(rate) * rate
        return rate, -0.1 * rate - 160.0 * angle * (1.0 + cubic * angle**2) - drag

    clock = np.arange(10000) / 1000.0
    solution = solve_ivp(motion, (0.0, 10.0), (0.35, 0.0), "DOP853", clock, rtol=1e-8, atol=1e-10)
    return solution.y[0]


@pytest.mark.parametrize(
    ("law", "damping", "frequency"),
    [
        ({"friction": 0.3, "quadratic": 0.0, "cubic": 0.0}, +1, 0),
        ({"friction": 0.0, "quadratic": 0.1, "cubic": 0.0}, -1, 0),
        ({"friction": 0.0, "quadratic": 0.0, "cubic": 0.5}, 0, -1),
    ],
    ids=["Coulomb friction", "quadratic damping", "hardening spring"],
)
def test_drift_of_damping_and_frequency_is_seen(law, damping, frequency):
    motion = nonlinear(**law)
    rng = np.random.default_rng(3)
    data = with_records(campaign(SETTING), lambda _, __: motion + 1e-4 * rng.standard_normal(motion.size))
    run = identify(data).runs[0]
    assert Status.MODEL_DEPARTS in run.statuses
    first, last = run.windows[0], run.windows[-1]
    for sign, name in ((damping, "zeta"), (frequency, "omega_n")):
        change = getattr(last, name).value - getattr(first, name).value
        if sign:
            assert np.sign(change) == sign
            assert abs(change) > 5.0 * np.hypot(getattr(last, name).std, getattr(first, name).std)
        else:
            assert abs(change) < 0.01 * first.omega_n.value


def test_roll_decay_of_the_tanker_damps_less_as_it_decays():
    estimate = identify(measured_campaign("kvlcc2-roll-decay-0kn"))
    assert Status.NO_STIFFNESS in estimate.statuses
    for run in estimate.runs:
        zeta = [window.zeta for window in run.windows]
        upper = [window.zeta.value for window in run.windows if window.amplitude.value > 0.09]
        assert upper == sorted(upper, reverse=True)
        # The source: .0095 at 10 degrees, .0040 at 2.5 degrees; eddy damping dominates.
        assert zeta[0].value > 1.5 * zeta[-1].value
        assert run.windows[0].omega_n.value > 1.003 * run.windows[7].omega_n.value


def test_rotary_pendulum_damps_more_as_it_decays():
    estimate = identify(measured_campaign("rotary-pendulum"))
    run = next(run for run in estimate.runs if run.id == "swing-3")
    assert run.windows[0].cycles == 1  # eight cycles are too few for windows of three
    small = [window for window in run.windows if window.amplitude.value < 0.8]
    damping = [window.zeta.value for window in small]
    assert damping == sorted(damping)
    assert damping[-1] > 2.0 * damping[0]  # dry friction
    frequency = [window.omega_n.value for window in run.windows]
    assert frequency == sorted(frequency)  # m g l sin(angle) softens with amplitude
    assert all(run.omega_n is not None for run in estimate.runs)
    coarse = identify(measured_campaign("rotary-pendulum"), OutputError(cycles_per_window=3))
    assert all(run.windows for run in coarse.runs)


def _pendulum(release: float, damping: float, *, duration: float = 30.0) -> Campaign:
    """One run of θ̈ + c θ̇ + 25 sin θ = 0, released at rest at an angle in degrees; c in 1/s."""
    time = np.arange(0.0, duration, 0.005)
    motion = solve_ivp(
        lambda _, y: [y[1], -25.0 * np.sin(y[0]) - damping * y[1]],
        (0.0, duration),
        [np.radians(release), 0.0],
        t_eval=time,
        rtol=1e-8,
        atol=1e-9,
    ).y[0]
    record = Record(time, motion + 0.002 * np.random.default_rng(1).standard_normal(time.size))
    return Campaign("pendulum", RigProperties(), SensorProperties(), (Run("top", record, 0.0),))


@pytest.mark.parametrize(("release", "damping"), [(175.0, 0.05), (170.0, 0.01), (170.0, 0.5)])
def test_a_pendulum_from_near_the_top_has_no_single_frequency(release: float, damping: float) -> None:
    run = identify(_pendulum(release, damping)).runs[0]
    assert Status.FREQUENCY_CHANGES in run.statuses
    assert Status.FREQUENCY_CHANGES.value.count("windows") == 2  # where the values are that describe it
    assert abs(run.omega_n.value - run.windows[-1].omega_n.value) < 2.0 * run.omega_n.std
    assert abs(run.zeta.value - damping / 10.0) < 2.0 * run.zeta.std


def test_a_swing_of_60_degrees_is_described_by_one_frequency() -> None:
    run = identify(_pendulum(60.0, 0.05, duration=10.0)).runs[0]
    assert Status.MODEL_DEPARTS in run.statuses
    assert Status.FREQUENCY_CHANGES not in run.statuses


def _gusts(size: float, seed: int) -> Run:
    """A decay at 10 rad/s with a random acceleration, white, of a size in rad/s^1.5."""
    rng = np.random.default_rng(seed)
    step, stiffness, rate = 0.01, 100.0, 0.2  # s, 1/s², 1/s
    kicks = size * step**1.5 * rng.standard_normal(4000)
    kicks[0] += 0.3
    motion = lfilter([1.0], [1.0, step * rate + step**2 * stiffness - 2.0, 1.0 - step * rate], kicks)
    record = Record(step * np.arange(4000.0), motion + 1e-4 * rng.standard_normal(4000))
    return Run("gusts", record, 0.0)


@pytest.mark.parametrize("seed", range(5))
def test_frequencies_that_wander_do_not_change_along_the_swing(seed: int) -> None:
    """A random moment leaves more than a hundredth of the motion, without a trend of the frequency."""
    fitted = identify_run(_gusts(1.5, seed), SensorProperties())
    assert fitted.fit is not None
    assert np.mean(fitted.fit.residual**2) > 0.02 * np.var(fitted.reading.yaw)
    assert Status.FREQUENCY_CHANGES not in fitted.estimate.statuses


def test_cycles_in_which_nothing_oscillates_are_skipped() -> None:
    """A random moment holds the body for a cycle, so that the fit to this cycle has no positive stiffness."""
    run = identify_run(_gusts(0.4, 1), SensorProperties(), cycles_per_window=1).estimate
    assert run.identified
    assert len(run.windows) > 20
    assert all(window.omega_n.value > 0.0 for window in run.windows)
