"""With a named lag, Cnr has two parts; the runs determine their sum in phase with the rate."""

from __future__ import annotations

import numpy as np
import pytest

from diagnosis.findings.averaged_coefficients import in_phase
from diagnosis.likelihood.least_squares import fit, fit_at
from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from tests.support.diagnosis_document import document, findings_of
from tests.support.gap_campaigns import CN_BETA, CN_R, campaign, nominal
from tests.support.rendered import coefficients_table, consequence
from tunnel_sim.effects import effect_class, effect_from

LAG = effect_class("unsteady_aero_lag")


@pytest.mark.parametrize("lag", [0.3, -0.3])
def test_the_sum_is_determined_far_better_than_its_parts(lag):
    data = campaign(effect_from(LAG.name, {"lag": lag}))
    base = nominal(data)
    found = fit(
        Problem(base.problem.data, (LAG,)), Point(np.append(base.point.common, lag), base.point.per_run)
    )
    estimates, covariance = in_phase(found)
    matrix = np.array(covariance)
    assert estimates["cn_r"].value == pytest.approx(CN_R - lag * CN_BETA, abs=0.01)  # of first order
    assert estimates["cn_r"].value == pytest.approx(base.value("cn_r"), abs=0.01)
    assert 20.0 * estimates["cn_r"].std < np.sqrt(matrix[1, 1])
    assert np.all(np.linalg.eigvalsh(matrix) > -1e-15)
    assert np.array_equal(matrix, matrix.T) or np.allclose(matrix, matrix.T, rtol=1e-9)
    assert (estimates["cn_beta"].value < found.value("cn_beta")) == (lag > 0.0)


def test_beside_a_form_that_the_runs_do_not_show_nothing_is_tried_beyond_its_range():
    """A tiny hysteresis leaves its roundness undetermined, with a deviation of thousands."""
    hysteresis = effect_class("sensor_hysteresis")
    base = nominal(campaign(effect_from(LAG.name, {"lag": 0.3})))
    own, form = [0.3, 1e-9, 0.99], (f"{hysteresis.name}.roundness",)
    problem = Problem(base.problem.data, (LAG, hysteresis), free_forms=form)
    found = fit_at(problem, Point(np.append(base.point.common, own), base.point.per_run))
    assert found.std(form[0]) > 1e4
    estimates, _ = in_phase(found)
    assert np.isfinite(estimates["cn_r"].std)


def test_without_a_lag_there_is_one_cn_r():
    assert in_phase(nominal(campaign())) == ({}, ())


def test_both_parts_are_said_and_the_sum_is_compared_with_the_nominal_model():
    given = document() | {"causes": [LAG.name]}
    same = {"value": -0.36, "std": 2e-4, "unit": "1/rad"}
    given["coefficients"] = {
        "before": {"cn_r": {"value": -0.3604, "std": 1e-3, "unit": "1/rad"}},
        "after": {"cn_r": {"value": -0.143, "std": 0.049, "unit": "1/rad"}},
        "in_phase": {"cn_r": same},
    }
    assert consequence(findings_of(given)) == (
        "The size of Cnr changes by less than 1 %. Of Cnr in phase with the rate, −0.36000 ± 0.00020, the lag "
        "contributes −0.217 and the rate itself −0.143 ± 0.049."
    )
    assert findings_of(given).coefficients.comparable["cn_r"].value == -0.36
    whole, own = coefficients_table(findings_of(given)).rows
    assert "in phase with the rate" in whole[0]
    assert "beside the lag" in own[0]
    assert own[1] == own[-1] == "–"
