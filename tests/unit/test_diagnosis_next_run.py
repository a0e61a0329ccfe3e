"""The run that would tell two models apart."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis.least_squares import fit, normal_equations, sensitivities
from diagnosis.next_run import separating_run
from diagnosis.problem import Point, Problem
from diagnosis.start import leads
from tests.unit.gap_campaigns import campaign, nominal
from tunnel_sim.effects import effect_class, effect_from


def fitted(base, name):
    lead = leads(base, effect_class(name))[0]
    return fit(lead.problem, lead.point, base=base)


@pytest.fixture(scope="module")
def rivals():
    data = campaign(effect_from("coulomb_friction", {"friction_moment": 0.003}))
    alike = replace(data, runs=tuple(run for run in data.runs if run.spring_stiffness == 16.12))
    base = nominal(alike)
    return fitted(base, "coulomb_friction"), fitted(base, "quadratic_damping")


def apart(first, second, run, angle):
    """What the second model's release cannot take up of the first one's prediction, in noise deviations."""
    predictions, slopes = [], []
    for one in (first, second):
        problem = Problem(one.problem.data.with_runs((run,)), one.problem.effects)
        point = Point(one.point.common, np.array([[angle, 0.0]]))
        predictions.append(problem.predict([point])[0][0] / np.sqrt(run.noise_variance))
        slopes.append(sensitivities(problem, point)[0][1])
    change = predictions[1] - predictions[0]
    return np.sqrt(normal_equations([(change[:, None], slopes[0])], [change])[0][0, 0])


def test_the_run_separates_as_promised_and_better_than_a_plain_one(rivals):
    found = separating_run(*rivals)
    assert found is not None
    template = rivals[0].problem.data.runs[0]

    def design(spring, speed, duration):
        count = round(duration / template.interval)
        return replace(template, reading=np.zeros(count), spring_stiffness=spring, wind_speed=speed,
                       air_density=1.2 if speed else 0.0, duration=duration)  # fmt: skip

    best = design(found["spring_stiffness"], found["wind_speed"], found["duration"])
    assert apart(*rivals, best, found["release_angle"]) == pytest.approx(found["separation"], rel=0.01)
    assert apart(*rivals, design(16.12, 15.0, 10.0), 0.35) < found["separation"]
    assert found["separation"] > 10.0


def test_a_model_is_not_told_from_itself(rivals):
    found = separating_run(rivals[0], rivals[0])
    assert found is not None
    assert found["separation"] == pytest.approx(0.0, abs=1e-6)


def test_runs_without_stiffness_propose_none():
    data = campaign()
    runs = tuple(replace(run, spring_stiffness=None) for run in data.runs[:1])
    base = nominal(replace(data, runs=runs))
    assert separating_run(base, base) is None
