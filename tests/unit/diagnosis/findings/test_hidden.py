"""Upper limits on undetected effects, against refits at those sizes, and intervals that do not depend on them."""

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.answer.linear_theory import starts_beside
from diagnosis.findings import hidden
from diagnosis.findings.averaged_coefficients import Answers, Possible, coefficients, possible_answers
from diagnosis.findings.hidden import hidden_effects
from diagnosis.findings.sections import printed
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.problem import Problem
from diagnosis.model.parameters import Point
from diagnosis.search.investigate import investigate, nominal_study
from tests.marks import slow
from tests.support.diagnosis_document import document, findings_of
from tests.support.gap_campaigns import CN_BETA, CN_R, NOISE, campaign, nominal, studied
from tests.support.rendered import hidden_line, hidden_table
from tests.support.scattered_runs import SCATTERED, scattered
from tests.unit.diagnosis.noise.test_colour import colour, with_zero
from tunnel_sim.effects import ALL_EFFECTS, effect_class, effect_from, known_effects
from tunnel_sim.files.writing import as_json


def found_beside(data, *names):
    base = nominal(data)
    kinds = [effect_class(name) for name in names]
    return base, {one.effect: one for one in hidden_effects(base, starts_beside(base, kinds))}


def refitted(base, one):
    """The fit with an effect held at its largest size."""
    kind = effect_class(one.effect)
    severity = f"{kind.name}.{one.parameter}"
    problem = Problem(base.problem.data, (kind,), ((severity, one.size.value),))
    return fit(problem, Point(base.point.common.copy(), base.point.per_run.copy()))


@pytest.mark.parametrize(
    "name", ["unsteady_aero_lag", "cubic_stiffness", "quadratic_damping", "wind_speed_offset"]
)
def test_a_refit_at_the_largest_size_is_four_units_above_the_least(name):
    """χ² falls to its least by as much as the likeliest size gains, so the refit lies up to four above the fit."""
    base, found = found_beside(campaign(), name)
    again = refitted(base, found[name])
    free = fit(
        Problem(base.problem.data, (effect_class(name),)),
        Point(np.append(base.point.common, 0.5 * found[name].size.value), base.point.per_run),
    )
    likeliest = free.value(f"{name}.{found[name].parameter}")
    least = (
        free.total if likeliest * found[name].size.value > 0.0 else base.total
    )  # of the sizes of that sign
    assert again.total - least == pytest.approx(4.0, abs=1.0)
    for coefficient, move in found[name].moves.items():
        assert abs(again.value(coefficient) - base.value(coefficient)) == pytest.approx(
            move.value, rel=0.1, abs=0.02 * base.std(coefficient)
        )


def test_a_rod_and_gravity_hide_no_frequency_of_small_swings():
    """Beside a spring that is not stated, both change what that spring seems to be, and not what the runs show."""
    data = campaign(duration=10.0)
    (still, *_) = (run for run in data.runs if run.wind_speed == 0.0)
    data = replace(data, runs=(replace(still, spring_stiffness=None),))
    base = nominal_study(data, known_effects()).prepared.nominal
    kinds = [effect_class(name) for name in ("rod_flexibility", "gravity_stiffness")]
    found = hidden_effects(base, starts_beside(base, kinds))
    assert "gravity_stiffness" in [one.effect for one in found]
    for one in found:
        # the spring's own frequency would move by 0.2 % and 0.3 %
        assert one.moves["omega_n"].value < 1e-4 * base.value("stiffness") ** 0.5, one.effect
        assert one.moves["zeta"].value < 1e-4, one.effect


def test_an_offset_of_the_only_wind_speed_is_not_listed():
    """Cnβ and Cnr absorb it: no run of this campaign could limit it."""
    data = campaign()
    one_speed = replace(data, runs=tuple(run for run in data.runs if run.wind_speed != 15.0))
    _, found = found_beside(one_speed, "wind_speed_offset", "unsteady_aero_lag")
    assert set(found) == {"unsteady_aero_lag"}


@pytest.mark.parametrize("lag", [0.01, slow(-0.01)])
def test_cn_r_without_a_named_lag_is_the_derivative_in_phase_with_the_rate(lag):
    """The lag is no error of Cnr, and its upper limit does not widen the interval."""
    data = campaign(effect_from("unsteady_aero_lag", {"lag": lag}))
    base = nominal(data)
    study = studied(data, base)
    without = coefficients(Answers((Possible(1.0, base),), 0.0, base), data)["cn_r"]
    given = coefficients(possible_answers(study, ALL_EFFECTS), data)["cn_r"]
    assert given.std == pytest.approx(without.std)
    assert abs(given.value - (CN_R - lag * CN_BETA)) < 3.0 * given.std
    assert abs(given.value - CN_R) > 5.0 * given.std
    assert "hidden effects" not in given.shares


@pytest.mark.slow
def test_the_upper_limit_of_a_lag_beside_scatter_is_confirmed_by_a_refit():
    """Chance differences absorb the second order of a small lag; linear theory alone allows ten times as much."""
    kind = effect_class("unsteady_aero_lag")
    chosen = investigate(
        scattered(), [effect_class(name) for name in (*SCATTERED, kind.name)], rivals=()
    ).stated
    assert chosen.problem.scatter
    (lag,) = hidden_effects(chosen, starts_beside(chosen, [kind]))
    assert lag.size.value > 0.0
    rises = []
    for factor in (1.0, 2.0):
        problem = replace(
            chosen.problem,
            effects=(*chosen.problem.effects, kind),
            fixed=(("unsteady_aero_lag.lag", factor * lag.size.value),),
        )
        start = chosen.point.common.copy()
        start[chosen.problem.names.index("cn_r")] += factor * lag.size.value * CN_BETA
        rises.append(
            fit(problem, Point(start, chosen.point.per_run.copy())).unlikelihood - chosen.unlikelihood
        )
    assert 1.0 <= rises[0] + lag.significance**2 <= 7.0
    assert rises[1] > 16.0


def test_the_table_and_the_sentence_state_sizes_and_moves_with_units():
    lag = {
        "effect": "unsteady_aero_lag",
        "parameter": "lag",
        "size": {"value": -0.0111, "std": None, "unit": "l/V"},
        "moves": {
            "cn_beta": {"value": 7.9e-6, "std": None, "unit": "1/rad"},
            "cn_r": {"value": 0.0061, "std": None, "unit": "1/rad"},
        },
    }
    given = document() | {"hidden": [lag]}
    for name, std in (("cn_beta", 1e-3), ("cn_r", 3e-3)):
        given["coefficients"]["after"][name] = {"value": -0.17, "std": std, "unit": "1/rad"}
    line = hidden_line(findings_of(given))
    assert "due to the rate alone differs by up to 0.0061 1/rad if a lag of 0.011 l/V" in line
    assert "Cnβ" not in line  # it moves far less than its standard deviation
    drift = {**lag, "effect": "wind_speed_drift", "size": {"value": 2e-4, "std": None, "unit": "1"}}
    both = hidden_line(findings_of(given | {"hidden": [lag, drift, {**drift, "effect": "coulomb_friction"}]}))
    assert both.endswith(
        "Wind speed drift of up to 0.020 % cannot be excluded and would change Cnr by 0.0061 1/rad."
    )
    vortex = {**drift, "effect": "vortex_shedding", "parameter": "coefficient"}
    rows = hidden_table(findings_of(given | {"hidden": [lag, drift, vortex]})).rows
    assert [row[1] for row in rows] == ["-0.011 l/V", "0.020 %", "0.00020"]  # a coefficient is not relative
    (row,) = hidden_table(findings_of(given)).rows
    assert row[0] == "unsteady aero lag"
    assert "0.0061" in row[-1]
    assert any(line in str(block) for block in printed(findings_of(given)))
    assert hidden_line(findings_of(given | {"hidden": []})) == ""


def test_an_effect_without_a_confirmed_limit_is_listed_as_not_determined(monkeypatch):
    names = ("unsteady_aero_lag", "wind_speed_drift")
    base, limited = found_beside(campaign(), *names)
    assert all(one.size.determined for one in limited.values())
    held = hidden._held

    def refit(fit, start, *rest):
        return None if start.problem.effects[-1].name == names[1] else held(fit, start, *rest)

    monkeypatch.setattr(hidden, "_held", refit)
    found = {one.effect: one for one in hidden_effects(base, starts_beside(base, map(effect_class, names)))}
    assert found[names[0]] == limited[names[0]]
    assert not found[names[1]].size.determined
    assert found[names[1]].moves == {}

    both = [as_json(found[name]) for name in reversed(names)]
    given = findings_of(document() | {"hidden": both})
    assert [one.size.determined for one in given.hidden] == [False, True]
    drift, lag = hidden_table(given).rows
    assert drift[:2] == ("wind speed drift", "not determined")
    assert set(drift[2:]) == {"–"}
    assert "–" not in lag
    assert hidden_line(given) == hidden_line(findings_of(document() | {"hidden": both[1:]}))


def test_a_refit_in_another_minimum_confirms_no_limit(monkeypatch):
    """Linear theory takes the effect for twice as large as it is, and all further refits fail."""
    name = "wind_speed_drift"
    base, limited = found_beside(campaign(), name)
    held, tried = hidden._held, []

    def refit(fit, start, size, _):
        again = held(fit, start, 0.5 * size, None)
        tried.append(abs(size))
        worse = 4e3 if abs(size) > tried[0] else 0.0
        return replace(again, chi2=again.chi2 + worse / again.chi2.size)

    monkeypatch.setattr(hidden, "_held", refit)
    (found,) = hidden_effects(base, starts_beside(base, [effect_class(name)]))
    assert limited[name].size.determined
    assert not found.size.determined
    assert found.moves == {}


def test_refits_that_end_too_high_are_made_again_from_a_nearer_one(monkeypatch):
    """A refit that starts further from its minimum than half of the limit ends in another minimum."""
    name = "wind_speed_drift"
    base, limited = found_beside(campaign(), name)
    held, limit = hidden._held, limited[name].size.value

    def refit(fit, start, size, near):
        again = held(fit, start, size, near)
        inside = near is not None and abs(near[0]) < 0.99 * abs(limit)
        worse = 0.0 if inside or abs(size) < 0.5 * abs(limit) else 6.0
        return replace(again, chi2=again.chi2 + worse / again.chi2.size)

    monkeypatch.setattr(hidden, "_held", refit)
    (found,) = hidden_effects(base, starts_beside(base, [effect_class(name)]))
    assert found.size.determined
    assert found.size.value == pytest.approx(limit, rel=0.1)


def test_a_drop_that_no_refit_confirms_does_not_prevent_a_limit(monkeypatch):
    """Linear theory foresees that the effect lowers −2 ln L by nine units, and it lowers it by chance only."""
    name = "wind_speed_drift"
    base, limited = found_beside(campaign(), name)
    largest, limit = hidden._largest, limited[name].size.value

    def wrong(*given):
        one = largest(*given)
        return replace(one, size=2.0 * one.size, likeliest=one.size, lowered=9.0)

    monkeypatch.setattr(hidden, "_largest", wrong)
    (found,) = hidden_effects(base, starts_beside(base, [effect_class(name)]))
    assert found.size.determined
    assert found.size.value == pytest.approx(limit, rel=0.2)


@pytest.mark.slow
@pytest.mark.usefixtures("causes_alone")
def test_a_further_effect_that_coloured_noise_takes_up_is_said_to_be_significant():
    """A drift of 1.5 mrad in every run, beside vortices in coloured noise that is twice as large as the white."""
    shedding = effect_from("vortex_shedding", {"amplitude": 0.1, "strouhal_number": 0.12})

    def zero(count, rng):
        return 2.0 * NOISE * colour("ar2", count, rng) + 1.5e-3 * np.arange(count) / count

    kinds = [effect_class(name) for name in ("vortex_shedding", "sensor_drift", "coulomb_friction")]
    found = diagnose(with_zero(campaign(shedding), zero), kinds=kinds, rivals=())
    assert found.causes == ("vortex_shedding",)
    assert found.rest.significant
    assert "Sensor drift is significant, but too small to be named." in found.verdict
    (drift,) = (one for one in found.hidden if one.effect == "sensor_drift")
    assert drift.significance > 5.0
    assert abs(drift.size.value) > 1.5e-3


def test_an_effect_of_one_sign_that_the_runs_pull_below_zero_has_a_significance_of_zero():
    one_sided = (
        "free_play",
        "sensor_hysteresis",
        "coulomb_friction",
        "structural_damping",
        "quadratic_damping",
    )
    _, found = found_beside(campaign(), *one_sided)
    none = [one for one in found.values() if one.size.determined and one.significance == 0.0]
    assert none
    assert [str(one.significance) for one in none] == ["0.0"] * len(none)
