"""A second mode beside the motion is named; a harmonic of the motion is not."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.findings.other_motions import Mode, TwoModes, second_mode_words, second_modes
from diagnosis.likelihood.starting_points import misses_motion
from diagnosis.search.investigate import investigate
from tests.marks import slow
from tunnel_sim.effects import effect_class, effect_from
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")


def campaign(*modes: tuple[float, float, float], seconds: float = 20.0) -> Campaign:
    """One run with oscillations given by amplitude (rad), frequency (Hz) and decay rate (1/s)."""
    time = np.arange(int(100 * seconds)) / 100.0
    yaw = np.random.default_rng(3).normal(0.0, 1e-4, time.size)
    for amplitude, frequency, rate in modes:
        yaw += amplitude * np.exp(-rate * time) * np.cos(2.0 * np.pi * frequency * time + 0.3)
    run = Run("swing", Record(time, yaw), 0.0)
    return Campaign("modes", RigProperties(), SensorProperties(100.0), (run,))


MOTION = (0.3, 2.2, 0.1)


@pytest.mark.parametrize("rate", [0.2, 0.9])
def test_a_second_mode_is_named_even_where_it_decays_in_a_quarter_of_the_run(rate):
    (found,) = second_modes(campaign(MOTION, (0.02, 2.9, rate)))
    assert found.run == "swing"
    assert found.second.frequency_hz == pytest.approx(2.9, rel=0.01)
    assert (found.main.amplitude_rad, found.main.frequency_hz) == pytest.approx((0.3, 2.2), rel=0.02)
    assert 0.5 < found.closes <= 1.0


def test_one_sentence_says_the_second_modes_of_all_runs():
    first = TwoModes("a", Mode(0.3, 2.2, 0.1), Mode(0.02, 2.9, 0.2), 0.98)
    text = second_mode_words([first], "rad")
    assert text.startswith(
        "Run a contains a second mode: 1.1° at 2.90 Hz, decaying at 0.20 1/s. The main mode is 17° at"
    )
    assert "explains 98 % of the residual" in text
    other = TwoModes("b", Mode(0.15, 3.3, 0.1), Mode(0.04, 2.9, 0.3), 0.6)
    text = second_mode_words([first, other], "rad")
    assert text.startswith(
        "2 runs (a and b) contain a second mode: 1.1 to 2.3° at 2.90 Hz, decaying at 0.20 to 0.30 1/s. "
        "The main mode is 8.6 to 17° at 2.20 to 3.30 Hz, decaying at 0.10 1/s. The second mode explains 60 to 98 %"
    )
    assert second_mode_words([], "rad") == ""


@pytest.mark.parametrize(("mains", "named"), [(2.91, False), (1.46, False), (2.5, True), (50.0, True)])
def test_a_hum_and_its_harmonics_are_no_mode(mains, named):
    assert bool(second_modes(campaign(MOTION, (0.02, 2.9, 0.2)), mains)) is named


@pytest.mark.parametrize("others", [(), ((0.02, 6.6, 0.3),), ((0.02, 2.21, 0.1),)])
def test_one_mode_its_harmonic_and_a_mode_that_is_not_resolved_are_not_named(others):
    assert second_modes(campaign(MOTION, *others)) == ()


def test_what_dies_out_within_a_tenth_of_a_cycle_is_no_mode():
    assert second_modes(campaign(MOTION, (0.1, 0.5, 5.0))) == ()


@pytest.mark.parametrize(
    ("mode", "seconds"),
    [
        ((0.05, 0.6, 0.45), 20.0),  # 1.3 cycles within its decay
        ((0.05, 0.9, 0.4), 20.0),
        ((0.05, 0.35, 0.02), 5.0),  # 1.8 cycles within its record
    ],
)
def test_what_shows_fewer_than_three_cycles_is_no_mode(mode, seconds):
    assert second_modes(campaign(MOTION, mode, seconds=seconds)) == ()


@pytest.mark.parametrize(
    ("frequency", "damping", "duration", "shown"),
    [
        (8.0, 0.01, 10.0, True),
        (8.0, 0.12, 10.0, False),  # 1.3 cycles within its decay
        (8.0, 0.2, 10.0, False),  # as the bound of the fits
        (8.0, 0.06, 10.0, False),
        (8.0, 0.045, 10.0, True),
        (8.0, 0.01, 2.0, False),  # 2.5 cycles within its record
        (8.0, 0.01, 2.5, True),
    ],
)
def test_an_effect_that_shows_fewer_than_three_cycles_is_not_a_second_mode(
    frequency, damping, duration, shown
):
    given = {"amplitude": 0.01, "frequency": frequency, "damping_ratio": damping}
    mode = effect_from("second_mode", given)
    assert mode.plausible(13.0, duration, (-0.3, 0.3)) == shown


def test_a_second_mode_is_said_only_where_it_may_be_named():
    data = two_modes(0, 0.5)
    tried = diagnose(data, kinds=[effect_class(name) for name in ("cubic_stiffness", "dropped_samples")])
    assert tried.causes == ("unknown",)
    assert tried.found.second_modes == ()
    assert "second mode" not in tried.verdict


LARGER = (0.114, 2.844, 0.93)  # than the motion at the release, and decaying faster
SWING = (0.079, 2.232, 0.24)
MODES = [effect_class(name) for name in ("second_mode", "cubic_stiffness", "coulomb_friction")]


def test_a_mode_near_the_motion_is_named_where_the_motion_is_lost():
    answer = diagnose(campaign(SWING, LARGER, seconds=9.0), kinds=MODES)
    assert answer.causes == ("second_mode",)
    size = answer.candidates[0].parameters["amplitude"]
    assert size.value == pytest.approx(LARGER[0], abs=4.0 * size.std)
    assert answer.coefficients.after["omega_n"].value == pytest.approx(2.0 * np.pi * SWING[1], rel=1e-3)


def test_a_second_mode_is_said_where_a_third_hides_it():
    answer = diagnose(campaign(SWING, LARGER, (0.06, 3.7, 0.3), seconds=9.0), kinds=MODES)
    assert answer.causes == ("unknown",)
    assert "contains a second mode" in answer.verdict


def two_modes(derivative, share):
    """Two runs of two uncoupled modes in closed form, with noise of a thousandth."""
    rng, time, runs = np.random.default_rng(1), np.arange(1500) / 100.0, []
    for name in ("r0", "r1"):
        reading = np.zeros(time.size)
        for size, hertz, rate, phase in (
            (0.2, 1.1, 0.05, 0.3),
            (0.2 * share, 1.75, 0.12, rng.uniform(0.0, 6.28)),
        ):
            exponent = complex(-rate, 2.0 * np.pi * hertz)
            reading += (size * exponent**derivative * np.exp(exponent * time + 1j * phase)).real
        runs.append(
            Run(name, Record(time, reading + 1e-3 * np.std(reading) * rng.standard_normal(time.size)), 0.0)
        )
    quantity = ("angle", "rate", "acceleration")[derivative]
    return Campaign("two modes", RigProperties(), SensorProperties(100.0, quantity=quantity), tuple(runs))


@pytest.mark.parametrize("derivative", [0, slow(1), slow(2)])
@pytest.mark.parametrize(
    "share", [0.05, 0.5]
)  # with the larger one the nominal model misses the motion itself
def test_a_second_mode_is_an_answer_however_large_and_whatever_the_sensor_measures(derivative, share):
    study = investigate(two_modes(derivative, share), MODES)
    assert misses_motion(study.nominal) == (share > 0.1)
    assert study.fitted == ("second_mode",)
    assert study.answers[0].probability > 0.9
    found = study.chosen
    assert found.value("second_mode.amplitude") == pytest.approx(0.2 * share, rel=2e-3)
    frequency = study.similarity.own(found.value("second_mode.frequency"), "rad/s")
    assert frequency == pytest.approx(2.0 * np.pi * 1.75, rel=1e-3)


@pytest.mark.parametrize("form", ["drift", slow("step")])
def test_a_wandering_zero_is_not_a_missed_motion(form):
    """It holds far more than a hundredth of the power."""
    time, rng = np.arange(1500) / 100.0, np.random.default_rng(1)
    wander = time / time[-1] if form == "drift" else np.where(time > 5.0, 1.0, 0.0)
    size = 0.1 if form == "drift" else 0.05
    yaw = 0.2 * np.exp(-0.1 * time) * np.cos(7.0 * time) + size * wander + rng.normal(0.0, 2e-4, time.size)
    runs = (Run("r0", Record(time, yaw), 0.0),)
    kinds = [effect_class(name) for name in ("sensor_drift", "cubic_stiffness", "coulomb_friction")]
    study = investigate(Campaign("wander", RigProperties(), SensorProperties(100.0), runs), kinds)
    assert not misses_motion(study.nominal)
    assert not study.prepared.cut
    if form == "drift":
        assert study.fitted == ("sensor_drift",)
        assert study.answers[0].probability > 0.9
