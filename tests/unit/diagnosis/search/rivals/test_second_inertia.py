"""A second inertia behind a spring, between motor and link: exact records of linear joints of one and two inertias.

Truth: the matrix exponential of the equations of motion under a held moment.
"""

import numpy as np
import pytest
from scipy.linalg import expm

from diagnosis import diagnose
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.rivals.second_inertia import TwoInertias
from tests.marks import slow
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

RATE, NOISE = 200.0, 2e-4  # Hz, rad
MOTOR, LINK, DAMPING = 0.06, 0.04, 0.2  # kg m2, kg m2, N m s/rad at the motor
RESONANCE, RATIO = 8.0, 0.02  # Hz with both inertias free, share of critical damping
ANTIRESONANCE = RESONANCE * np.sqrt(MOTOR / (MOTOR + LINK))
KINDS = [
    effect_class(name)
    for name in ("coulomb_friction", "actuator_lag", "input_delay", "gravity_stiffness", "rod_flexibility")
]


def transition(motion, by_moment):
    """The step of a linear motion from sample to sample, and its change by a held moment."""
    size = len(motion)
    both = np.zeros((size + 1, size + 1))
    both[:size, :size], both[:size, size] = motion, by_moment
    step = expm(both / RATE)
    return step[:size, :size], step[:size, size]


def two_inertias():
    reduced = MOTOR * LINK / (MOTOR + LINK)
    turn = 2.0 * np.pi * RESONANCE
    spring, loss = reduced * turn**2, 2.0 * RATIO * reduced * turn
    motion = np.zeros((4, 4))  # angles of motor and link, then their rates
    motion[:2, 2:] = np.eye(2)
    motion[2] = np.array([-spring, spring, -loss - DAMPING, loss]) / MOTOR
    motion[3] = np.array([spring, -spring, loss, -loss]) / LINK
    return motion, np.array([0.0, 0.0, 1.0 / MOTOR, 0.0])


def one_inertia():
    inertia = MOTOR + LINK
    return np.array([[0.0, 1.0], [0.0, -DAMPING / inertia]]), np.array([0.0, 1.0 / inertia])


def filtered(moment):
    """A moment behind a lag of 20 ms, from sample to sample."""
    step = np.exp(-1.0 / (0.02 * RATE))
    found, state = np.empty_like(moment), moment[0]
    for place, value in enumerate(moment):
        found[place] = state
        state = value + step * (state - value)
    return found


def joint(system, sensor=0, acting=lambda moment: moment, colour=0.0):
    """Two runs of a joint that nothing holds, with the angle of one of its inertias."""
    step, gain = transition(*system)
    rng, time, runs = np.random.default_rng(1), np.arange(0.0, 6.0, 1.0 / RATE), []
    for number in range(2):
        lines = np.outer(time, np.arange(0.2, 14.0, 0.2))
        moment = np.sin(2.0 * np.pi * (lines + rng.uniform(size=lines.shape[1]))).sum(axis=1) / 6.0
        state, angle = np.zeros(len(gain)), np.empty(time.size)
        for place, value in enumerate(acting(moment)):
            angle[place] = state[sensor]
            state = step @ state + gain * value
        noise = rng.normal(0.0, NOISE, time.size)
        for place in range(1, time.size):
            noise[place] += colour * noise[place - 1]
        record = Record(time, angle + noise)
        drive = Input("moment_nm", moment, hold="zero")
        runs.append(Run(f"run-{number}", record, wind_speed=0.0, spring_stiffness=0.0, drive=drive))
    return Campaign("joint", RigProperties(), SensorProperties(RATE), tuple(runs))


def second_inertia(found):
    """The figures of the second inertia; None where the diagnosis states none."""
    (figures,) = [fact.figures for fact in found.found.rivals if fact.kind == "second inertia"] or [None]
    return figures


def near(stated, truth):
    return abs(stated["frequency_hz"] - truth) < 4.0 * stated["std_hz"] < 0.05 * truth


def test_a_link_behind_a_spring_shows_both_frequencies_and_the_ratio_at_the_motor():
    found = diagnose(joint(two_inertias()), kinds=KINDS[:3], rivals=(TwoInertias(),))
    assert tuple(found.causes) == UNKNOWN
    figures = second_inertia(found)
    assert near(figures["resonance"], RESONANCE)
    assert near(figures["antiresonance"], ANTIRESONANCE)
    assert abs(figures["ratio"]["value"] - LINK / MOTOR) < 4.0 * figures["ratio"]["std"] < 0.1
    assert "A second inertia behind a spring, between motor and link, would explain the gap" in found.verdict
    assert "the angle is measured at the motor" in found.verdict


@pytest.mark.slow
def test_at_the_link_there_is_no_antiresonance():
    found = diagnose(joint(two_inertias(), sensor=1), kinds=KINDS[:-1], rivals=(TwoInertias(),))
    assert tuple(found.causes) == UNKNOWN
    figures = second_inertia(found)
    assert near(figures["resonance"], RESONANCE)
    assert "ratio" not in figures
    assert "without an antiresonance: the angle is measured at the link" in found.verdict


@pytest.mark.parametrize(
    "single",
    [
        {"acting": filtered},
        slow({"acting": lambda moment: np.roll(moment, 3)}),
        slow({"acting": lambda moment: np.clip(moment, -0.4, 0.4)}),
        slow({"colour": 0.95}),
    ],
    ids=["lag", "delay", "clipped", "coloured noise"],
)
def test_one_inertia_is_not_called_two(single):
    found = diagnose(joint(one_inertia(), **single), kinds=KINDS[:3], rivals=(TwoInertias(),))
    assert second_inertia(found) is None
    assert "second inertia" not in found.verdict
