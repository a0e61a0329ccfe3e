"""An input that acts later than its stamps. The truth is a moment known at all times, integrated by SciPy."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import kinds_for
from diagnosis.findings.verdict import headline
from diagnosis.model.rig import SpringModel
from tests.marks import slow
from tunnel_sim.effects import ALL_EFFECTS, Effect
from tunnel_sim.effects.sensor import InputDelay
from tunnel_sim.engine.virtual_campaign import plan_effects
from tunnel_sim.files.plan_file import paper_plan
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.plan import EffectSetting
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

RATE, INERTIA, DAMPING, SPRING, NOISE = 500.0, 0.1, 0.05, 16.0, 3e-4
TIME = np.arange(6000) / RATE
DELAY = InputDelay
FEW = vocabulary([DELAY.name, "quadratic_damping", "cubic_stiffness"])


@cache
def campaign(delay: float = 0.0, lag: float = 0.0, cubic: float = 0.0) -> Campaign:
    """Two runs over the resonance at 2 Hz, whose moment is smooth; the sensor may be a filter of first order."""

    def run(seed: int) -> Run:
        rng = np.random.default_rng(seed)
        omega = 2.0 * np.pi * np.arange(1.0, 3.0, 1.0 / TIME[-1])
        phase = rng.uniform(0.0, 2.0 * np.pi, omega.size)

        def moment(t: float) -> float:
            return 0.1 * float(np.cos(omega * t + phase).sum())

        def slope(t: float, y: np.ndarray) -> list[float]:
            balance = moment(t - delay) - SPRING * (y[0] + cubic * y[0] ** 3) - DAMPING * y[1]
            return [y[1], balance / INERTIA, (y[0] - y[2]) / lag if lag else 0.0]

        path = solve_ivp(
            slope, (0.0, TIME[-1]), [0.02, 0.0, 0.02], "DOP853", TIME, rtol=1e-8, atol=1e-10, max_step=0.02
        )
        reading = path.y[2 if lag else 0] + NOISE * rng.standard_normal(TIME.size)
        values = np.array([moment(t) for t in TIME])
        return Run(
            f"r{seed}", Record(TIME, reading), 0.0, spring_stiffness=SPRING, drive=Input("moment_nm", values)
        )

    return Campaign("driven", RigProperties(), SensorProperties(sample_rate=RATE), (run(0), run(1)))


SLOW = pytest.mark.slow


# two samples, 3 % of the period, late stamps
@pytest.mark.parametrize(
    ("delay", "kinds"),
    [(0.004, FEW), slow(0.004, ALL_EFFECTS), slow(0.015, ALL_EFFECTS), slow(-0.004, ALL_EFFECTS)],
)
def test_it_is_named_with_its_value(delay: float, kinds: Sequence[type[Effect]]) -> None:
    found = diagnose(campaign(delay), kinds=kinds)
    assert found.causes == (DELAY.name,)
    own = found.candidates[0].parameters["delay"]
    assert own.unit == "s"
    assert own.std is not None
    assert abs(own.value - delay) < 3.0 * own.std < 1e-4
    assert found.gap.closed > 0.99
    assert found.sizes == ()  # it has none in a free decay
    assert found.found.readings == ()  # no hold is wrong by two samples
    # of 4 ms, ωτ is 0.05 at the resonance: a lag of the actuator is then nearly the same
    rival = 0.0 < delay < 0.01 and kinds is ALL_EFFECTS
    said = headline(found)[0]
    assert said.startswith("either input delay") if rival else said == "input delay"
    assert ("actuator lag" in said) == rival


@SLOW
def test_it_is_named_beside_another_cause() -> None:
    found = diagnose(campaign(0.015, cubic=2.0))
    assert set(found.causes) == {DELAY.name, "cubic_stiffness"}
    own = found.candidates[0].parameters[f"{DELAY.name}.delay"]
    assert own.std is not None
    assert abs(own.value - 0.015) < 3.0 * own.std


@SLOW
@pytest.mark.parametrize("cubic", [0.0, 2.0])
def test_it_is_not_named_where_there_is_none(cubic: float) -> None:
    assert diagnose(campaign(cubic=cubic)).causes == (("cubic_stiffness",) if cubic else ())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kinds", "name", "parameter"),
    [(FEW, DELAY.name, "delay"), (ALL_EFFECTS, "actuator_lag", "lag")],
    ids=["few", "all"],
)
def test_a_lag_of_the_sensor_far_above_the_band_is_a_delay_of_the_input_or_a_lag_of_the_actuator(
    kinds: Sequence[type[Effect]], name: str, parameter: str
) -> None:
    """The page what-no-driven-record-can-show.md says so: of a lag of 5 ms, ωT is 0.06 at the resonance."""
    found = diagnose(campaign(lag=0.005), kinds=kinds)
    assert found.causes == (name,)
    assert found.candidates[0].parameters[parameter].value == pytest.approx(0.005, rel=0.01)
    assert DELAY.name in [one.effect for one in found.candidates]


def test_a_small_delay_changes_stiffness_and_damping_as_the_page_says() -> None:
    a, k, delay, omega = 0.25, 160.0, 1e-4, np.linspace(6.0, 20.0, 15)
    seen = (k - omega**2 + 2j * a * omega) * np.exp(1j * omega * delay)
    assert np.allclose(seen.real + omega**2, k - 2.0 * a * delay * omega**2, rtol=0.0, atol=1e-3)
    assert np.allclose(seen.imag / omega, 2.0 * a + (k - omega**2) * delay, rtol=0.0, atol=1e-5)


def test_it_is_left_out_without_a_word_where_no_run_is_driven() -> None:
    driven = campaign()
    free = replace(driven, runs=tuple(replace(run, drive=None) for run in driven.runs))
    assert kinds_for(free, ALL_EFFECTS, SpringModel()) == (
        tuple(kind for kind in ALL_EFFECTS if not kind.driven),
        (),
    )
    assert DELAY in kinds_for(driven, ALL_EFFECTS, SpringModel())[0]


def test_a_plan_of_free_decays_refuses_it_in_one_line() -> None:
    plan = replace(paper_plan(), effects=(EffectSetting(DELAY.name, {"delay": 0.01}),))
    with pytest.raises(TunnelError, match="acts on driven runs only") as caught:
        plan_effects(plan)
    assert "\n" not in str(caught.value)
