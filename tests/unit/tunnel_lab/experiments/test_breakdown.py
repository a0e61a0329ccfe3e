"""The breakdown map's campaigns and what becomes of them; truth: the reference simulator."""

import polars as pl
import pytest

from tunnel_lab.experiments import breakdown as view
from tunnel_lab.experiments import breakdown as work
from tunnel_lab.experiments.experiment import results_of
from tunnel_lab.experiments.runner import processes
from tunnel_sim.vocabulary.errors import TunnelError

NAMES = ("matrix_pencil", "conventional")
EFFECTS = ("coulomb_friction", "sensor_drift")


@pytest.fixture(scope="module")
def cases():
    return work.make_cases(1, realisations=2, effects=EFFECTS, severities=(10.0,), duration=3.0)


@pytest.fixture(scope="module")
def found(cases):
    return work.breakdown_frame(results_of(work.breakdown_of(cases, NAMES, 1), None, processes(0))[0])


def test_a_case_is_named_for_its_effect_and_severity(monkeypatch):
    monkeypatch.setattr(work, "size_effects", lambda draws, **_: draws)
    cases = work.make_cases(1, realisations=1, effects=EFFECTS[:1], severities=(10.0,), duration=0.2)
    assert [(case.effect, case.severity) for case in cases] == [("no effect", 0.0), (EFFECTS[0], 10.0)]
    assert list(map(work.case_name, cases)) == ["no_effect-0-0", "coulomb_friction-10-0"]


@pytest.mark.slow
def test_friction_biases_damping_and_nothing_biases_none(found):
    def expr(effect, quantity, name):
        wanted = {"effect": effect, "quantity": quantity, "estimator": name}
        return pl.all_horizontal(pl.col(key) == value for key, value in wanted.items())

    def bias(effect, quantity, name="matrix_pencil"):
        return found.row(by_predicate=expr(effect, quantity, name), named=True)

    none, friction = bias("no effect", "mechanical_damping"), bias("coulomb_friction", "mechanical_damping")
    assert abs(none["bias_in_stds"]) < 5.0
    assert friction["bias_percent"] > 20.0 * abs(none["bias_percent"])
    assert friction["bias_percent"] > 0.0  # dry friction takes energy, as more damping would


def test_estimators_that_give_no_coefficient_are_refused():
    rows = [("no effect", 0.0, "hilbert", name, None, "ok") for name in work.PARAMETERS]
    columns = ("effect", "severity", "estimator", "quantity", "value", "status")
    results = pl.DataFrame(rows, schema=columns, schema_overrides={"value": pl.Float64}, orient="row")
    with pytest.raises(TunnelError, match="give none of cn_beta"):
        view.breakdown_view(results)


def test_all_effects_of_the_vocabulary_have_a_form_to_inject():
    conditions = work.conditions_of(1)
    for name in work.EFFECTS:
        assert work.draw_effect(conditions, name, 1.0, 1).effects[0].form.family == name


def test_realisations_have_noise_and_random_forcing_of_their_own():
    conditions = work.conditions_of(1)
    cases = [work.draw_effect(conditions, name, 1.0, 1) for name in ("coulomb_friction", "buffeting")]
    made = [[work.realised(case, number, 1) for number in range(3)] for case in cases]
    assert len({one.seed for of_case in made for one in of_case}) == 6
    steady, random = made
    assert all(one.effects is cases[0].effects for one in steady)
    assert random[0].effects is cases[1].effects  # as it was sized
    seeds = [one.effects[0].extra["seed"] for one in random]
    assert len(set(seeds)) == 3
    again = work.realised(cases[1], 2, 1)
    assert (again.seed, again.effects[0].extra["seed"]) == (random[2].seed, seeds[2])
