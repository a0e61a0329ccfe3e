"""What a cause does to a swing: damping, frequency and the angle at which friction holds.

Truth: the equivalent damping ratio of friction and the frequency of a hardening spring by harmonic balance, and the
balance of friction and spring.
"""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis.findings.cause_sizes import CauseSize, cause_sizes
from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.residuals import linear_coefficients
from diagnosis.likelihood.starting_points import starting_points
from tests.support.gap_campaigns import added, campaign, nominal, studied
from tunnel_sim.effects import effect_class, effect_from, known_effects


def sized(name: str, **parameters: float) -> tuple[CauseSize, Fit]:
    data = campaign(effect_from(name, parameters))
    base = nominal(data)
    best = added(base, name)
    (size,) = cause_sizes(studied(data, base, (name,), best))
    assert size.effect == name
    return size, best


def softest(best: Fit, size: CauseSize) -> tuple[float, float, float]:
    """Inertia, damping and stiffness of the run whose conditions are taken, which has the softest spring."""
    runs = best.problem.data.runs
    index = [run.id for run in runs].index(size.run)
    assert runs[index].spring_stiffness == min(run.spring_stiffness for run in runs)
    return linear_coefficients(best, index)


def test_dry_friction_adds_to_the_damping_and_holds_the_body() -> None:
    size, best = sized("coulomb_friction", friction_moment=0.003)
    _, _, stiffness = softest(best, size)
    friction = best.value("coulomb_friction.friction_moment")
    assert size.stands == pytest.approx(friction / stiffness)
    # An envelope that falls by 4 Tc/K a cycle has the ratio 2 Tc/(π K A); A falls by a little in three cycles.
    ratio = 2.0 * friction / (np.pi * stiffness * size.amplitude)
    assert size.damping_ratio - size.damping_ratio_without == pytest.approx(ratio, rel=0.2)
    assert abs(size.frequency_change) < 1e-4
    assert size.amplitude == pytest.approx(0.5 * best.problem.data.swing)


def test_a_hardening_spring_raises_the_frequency() -> None:
    size, best = sized("cubic_stiffness", coefficient=0.05)
    kind = effect_class("cubic_stiffness")
    value = best.value(f"cubic_stiffness.{kind.parameters()[0].name}")
    assert size.stands == 0.0
    assert size.frequency_change == pytest.approx(0.375 * value * size.amplitude**2, rel=0.2)
    assert size.damping_ratio == pytest.approx(size.damping_ratio_without, rel=0.05)
    assert size.reading_change > 0.0


def test_a_spring_that_is_off_is_sized_on_a_run_that_has_it() -> None:
    data = campaign(effect_from("spring_miscalibration", {"error": 0.03, "spring_stiffness": 44.84}))
    base = nominal(data)
    leads = starting_points(base, effect_class("spring_miscalibration"))
    fits = [fit(lead.problem, lead.point, base=base) for lead in leads]
    best = next(
        one for one in fits if dict(one.problem.fixed)["spring_miscalibration.spring_stiffness"] == 44.84
    )
    (size,) = cause_sizes(studied(data, base, ("spring_miscalibration",), best))
    assert next(run for run in data.runs if run.id == size.run).spring_stiffness == 44.84
    assert size.frequency_change == pytest.approx(np.sqrt(1.03) - 1.0, rel=0.02)
    assert size.reading_change > 0.0


def test_every_effect_says_what_to_do_about_it() -> None:
    for kind in known_effects():
        assert kind.advice, kind.name
        assert not kind.advice.endswith("."), kind.name
        assert "release" not in kind.advice, kind.name  # a driven run has none
    assert len({kind.advice for kind in known_effects()}) == len(known_effects())
