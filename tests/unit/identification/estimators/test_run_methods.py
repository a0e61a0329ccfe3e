"""What the run-by-run methods are for: backbones, peaks' scatter, runs that contradict each other."""

from dataclasses import replace

import numpy as np
import pytest

from identification import NoiseLevel, identify
from identification.estimators.hilbert import Hilbert
from identification.signal.run_fit import ResidualCheck
from tests.marks import slow
from tests.reference.free_decays import TWELVE, Setting, campaign
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("unexamined")


def decaying(law, *, frequency=2.0, noise=0.0, seed=1):
    """A run whose envelope obeys dA/dt = −law(A), by small steps, as a campaign of one."""
    data = campaign((Setting(16.12, 0.0),), duration=20.0)
    clock = data.runs[0].record.time_s
    amplitude, path = 0.35, []
    for _ in clock:
        path.append(amplitude)
        amplitude -= 1e-3 * law(amplitude)
    rng = np.random.default_rng(seed)
    yaw = np.array(path) * np.cos(2.0 * np.pi * frequency * clock) + noise * rng.standard_normal(clock.size)
    return replace(data, runs=(replace(data.runs[0], record=Record(clock, 0.01 + yaw)),))


def test_the_backbone_follows_the_amplitude():
    data = decaying(lambda a: 0.05 * a + 0.8 * a**2, noise=2e-4)
    windows = identify(data, "hilbert").runs[0].windows
    assert len(windows) >= 10
    for window in windows[:10]:
        expected = (0.05 + 0.8 * window.amplitude.value) / (4.0 * np.pi)
        assert abs(window.zeta.value - expected) < 4.0 * window.zeta.std + 0.03 * expected
        assert window.omega_n.value == pytest.approx(4.0 * np.pi, rel=2e-3)


def test_a_linear_run_has_a_flat_backbone_and_windows_can_be_left_out():
    data = campaign((Setting(16.12, 0.0),), noise=5e-4, rng=np.random.default_rng(2), duration=20.0)
    run = identify(data, "hilbert").runs[0]
    scores = [(w.zeta.value - run.zeta.value) / w.zeta.std for w in run.windows]
    assert 0.05 < np.mean(np.square(scores)) < 3.2
    assert Hilbert(cycles_per_window=0).estimate(data).runs[0].windows == ()


@pytest.mark.parametrize("name", ["log_decrement", "hilbert"])
def test_deviations_are_raised_where_a_line_does_not_fit(name):
    curved = identify(decaying(lambda a: 0.05 * a + 0.8 * a**2, noise=2e-4), name).runs[0]
    linear = identify(decaying(lambda a: 0.2 * a, noise=2e-4), name).runs[0]
    assert curved.zeta.std > 5.0 * linear.zeta.std
    assert linear.zeta.value == pytest.approx(0.2 / (4.0 * np.pi), abs=5.0 * linear.zeta.std)


def test_deviations_are_raised_to_those_of_least_squares_where_the_model_departs_only():
    own, least_squares = np.array([[1.0, 0.5], [0.5, 9.0]]), np.diag([4.0, 1.0])

    def widened(departs):
        noise = NoiseLevel(1e-3, "residual", 1e-3, 2.0, departs, False)
        return ResidualCheck(noise, least_squares).widened(own)

    assert np.array_equal(widened(False), own)
    assert np.sqrt(np.diag(widened(True))) == pytest.approx([2.0, 3.0])  # the larger one of each
    correlation = widened(True)[0, 1] / 6.0
    assert correlation == pytest.approx(0.5 / 3.0)


@pytest.mark.parametrize("name", ["matrix_pencil", "log_decrement", slow("filter_error"), slow("bayesian")])
def test_runs_that_contradict_each_other_widen_the_coefficients(name):
    data = campaign(TWELVE[:6], noise=5e-4, rng=np.random.default_rng(3))
    # One run of a spring half a percent stiffer than stated: its own deviations cannot show it.
    stiff = campaign((Setting(16.2, 0.0),), noise=5e-4, rng=np.random.default_rng(4)).runs[0]
    mixed = replace(data, runs=(replace(stiff, id="r01", spring_stiffness=16.12), *data.runs[1:]))
    assert identify(mixed, name).yaw_inertia.std > 5.0 * identify(data, name).yaw_inertia.std
