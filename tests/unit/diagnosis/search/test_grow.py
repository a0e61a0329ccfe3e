"""Sets of causes grown effect by effect: what is put in comes out first, whatever its number."""

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.problem import Problem
from diagnosis.likelihood.residuals import ChannelMisfit, misfit, resonance
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.model.parameters import Point
from diagnosis.search import grow as growth
from diagnosis.search import hypothesis as module
from diagnosis.search.grow import MOST_CAUSES, grow
from diagnosis.search.hypothesis import Hypothesis, with_forms
from diagnosis.search.sets import exchange, prune
from diagnosis.search.weigh import weigh
from diagnosis.settings import Settings
from tests.marks import slow
from tests.support import gap_campaigns
from tests.support.gap_campaigns import FOUR, INTERVAL, added, nominal, whole_runs
from tunnel_sim.effects import ALL_EFFECTS, effect_class, effect_from
from tunnel_sim.effects.base import NEAR_MOTION

DURATION = 6.0
SWING = (-0.3, 0.3)  # rad
campaign = partial(gap_campaigns.campaign, duration=DURATION, conditions=FOUR)
FEW = tuple(
    effect_class(name)
    for name in (
        "coulomb_friction",
        "quadratic_damping",
        "cubic_stiffness",
        "nonlinear_yaw_moment",
        "sensor_drift",
    )
)
THREE = {"coulomb_friction": 0.003, "cubic_stiffness": -0.05, "sensor_drift": 0.003}  # of about equal gaps


def within_noise(found):
    """Whether the mean squared residual is one, within six standard deviations."""
    return abs(found.excess) < 6.0 * np.sqrt(2.0 / found.count)


@pytest.fixture(scope="module")
def of_three():
    """The growth on a campaign with three causes: the nominal fit, the sets tried and the sets found."""
    effects = [
        effect_from(name, {effect_class(name).parameters()[0].name: value}) for name, value in THREE.items()
    ]
    base, steps = nominal(campaign(*effects)), []
    return base, steps, grow(whole_runs(base, FEW), steps.append)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("coulomb_friction", {"friction_moment": 0.002}),
        slow("nonlinear_yaw_moment", {"coefficient": -0.5}),
        slow("rod_flexibility", {"compliance": 8e-5, "inertia_share": 0.1}),
        slow("sensor_clipping", {"limit": 0.33}),
    ],
)
def test_the_effect_put_in_fits_best_and_the_growth_ends_with_it(name, values):
    base = nominal(campaign(effect_from(name, values)))
    steps = []
    ranked = grow(whole_runs(base, [kind for kind in ALL_EFFECTS if kind.fitted]), steps.append)
    assert ranked[0].effects == (name,)
    assert within_noise(ranked[0].fit)
    assert all(len(hypothesis.effects) == 1 for hypothesis in ranked)
    assert {h.effects[0] for h in ranked} <= set(steps)
    totals = [h.fit.total for h in ranked]
    assert totals == sorted(totals)
    severity, value = next(iter(values.items()))
    found = ranked[0].fit
    # compliance and share of a rod form a narrow, curved valley: a refit stops in it short of the bottom
    tolerance = 0.1 * value if name == "rod_flexibility" else 5.0 * found.std(f"{name}.{severity}")
    assert abs(found.value(f"{name}.{severity}") - value) < tolerance


def test_a_set_of_two_is_found_and_fitted_once():
    drift = 2e-3 * np.linspace(0.0, 1.0, round(DURATION / INTERVAL))
    base = nominal(campaign(effect_from("quadratic_damping", {"coefficient": 0.003}), added=drift))
    ranked = grow(whole_runs(base, FEW))
    two = next(h for h in ranked if len(h.effects) == 2)
    assert two.names == ("quadratic_damping", "sensor_drift")
    assert two.fit.total < min(h.fit.total for h in ranked if len(h.effects) == 1)
    assert within_noise(two.fit)
    assert max(len(h.effects) for h in ranked) == 2
    assert len({h.names for h in ranked}) == len(ranked)


def test_a_set_of_three_is_found(of_three):
    base, steps, ranked = of_three
    three = next(h for h in ranked if len(h.effects) == 3)
    assert three.names == tuple(sorted(THREE))
    assert within_noise(three.fit)
    for name, value in THREE.items():
        key = f"{name}.{effect_class(name).parameters()[0].name}"
        assert abs(three.fit.value(key) - value) < 4.0 * three.fit.std(key)
    assert max(len(h.effects) for h in ranked) == 3 < MOST_CAUSES
    assert any(line.count(" + ") == 2 for line in steps)
    assert (
        weigh([h.fitted_set(base, misfit(base)) for h in ranked], misfit(base), Settings().weighing)[
            0
        ].effects
        == three.names
    )


def test_growth_ends_where_a_further_effect_closes_nothing():
    """Neither the air nor a spring clips a sensor: two of them leave what one leaves."""
    base = nominal(campaign(effect_from("sensor_clipping", {"limit": 0.33})))
    steps = []
    kinds = [effect_class(name) for name in ("nonlinear_yaw_moment", "quadratic_damping", "cubic_stiffness")]
    ranked = grow(whole_runs(base, kinds), steps.append)
    assert all(h.fit.excess > 0.99 * base.excess for h in ranked)
    assert max(line.count(" + ") for line in steps) == 1


def left(*effects, damping):
    """A set that leaves χ² in the damping; nothing else is read of it."""
    return SimpleNamespace(
        effects=effects,
        excess=np.array([damping, 0.0, 0.0, 0.0, 0.0, 0.0]),
        further_numbers=0,
        explains_runs=False,
        fit=SimpleNamespace(settings=Settings(), scatter_cost=lambda _: 0.0, shown_between_runs=0),
    )


GAP = ChannelMisfit(np.array([1e6, *[100.0] * 5]), np.full(6, 100.0), 1e7)


def test_a_set_goes_on_from_its_own_parent_though_the_best_set_is_a_dead_end():
    parents = [left("a", damping=2e5), left("b", damping=3e5)]
    children = [left("a", "c", damping=1.95e5), left("b", "d", damping=2e5)]
    assert [h.effects for h in growth.going_on(children, parents, GAP)] == [("b", "d")]
    assert growth.going_on(children[:1], parents, GAP) == []


def test_growth_ends_where_the_best_set_leaves_nothing_to_gain():
    parents = [left("a", damping=2e5)]
    assert growth.going_on([left("a", "c", damping=0.0)], parents, GAP) == []
    assert growth.going_on([left("a", "c", damping=5e4)], parents, GAP) != []


def test_pruning_fits_the_smaller_sets_that_are_missing(of_three):
    _, _, ranked = of_three
    whole = next(h for h in ranked if len(h.effects) == 3)
    smaller = prune(whole, [])
    assert {h.names for h in smaller} == {tuple(sorted(set(THREE) - {name})) for name in THREE}
    assert all(h.fit.total > whole.fit.total for h in smaller)
    grown = {h.names: h.fit.total for h in ranked}
    for hypothesis in smaller:
        if hypothesis.names in grown:
            assert hypothesis.fit.total == pytest.approx(grown[hypothesis.names], rel=0.02)
    assert prune(whole, [*ranked, *smaller]) == []


def test_pruning_gives_a_part_the_form_that_the_whole_needs():
    """Growth may free the form of friction beside another effect only, which then explains nothing."""
    friction = effect_from("coulomb_friction", {"friction_moment": 0.01, "presliding": 0.05})
    base = nominal(campaign(friction, duration=8.0))
    both = effect_class("coulomb_friction"), effect_class("sensor_drift")
    free = ("coulomb_friction.presliding",)
    known = dict(zip(base.problem.names, base.point.common.tolist(), strict=True))
    known |= {"coulomb_friction.friction_moment": 0.01, free[0]: 0.05}

    def fitted(*kinds, forms=()):
        problem = Problem(base.problem.data, kinds, free_forms=forms)
        start = np.array([known.get(name, 0.0) for name in problem.names])
        return Hypothesis(tuple(kind.name for kind in kinds), fit(problem, Point(start, base.point.per_run)))

    whole, textbook = fitted(*both, forms=free), fitted(both[0])
    better = next(h for h in prune(whole, [textbook]) if h.effects == ("coulomb_friction",))
    assert better.fit.problem.free_forms == free
    assert better.fit.total < 0.5 * textbook.fit.total
    assert better.textbook is textbook.fit
    assert prune(whole, [better, fitted(both[1])]) == []
    assert prune(fitted(*both), [textbook, fitted(both[1])]) == []


ALIKE = ("gravity_stiffness", "spring_miscalibration")  # two springs cannot tell one from the other


def test_of_effects_that_do_the_same_one_is_grown_and_the_others_are_weighed_beside_it():
    wrong = effect_from("spring_miscalibration", {"error": 0.004, "spring_stiffness": 16.12})
    friction = effect_from("coulomb_friction", {"friction_moment": 0.002})
    base, steps = nominal(campaign(wrong, friction, duration=8.0)), []
    kinds = [effect_class(name) for name in (*ALIKE, "coulomb_friction", "sensor_drift")]
    ranked = grow(whole_runs(base, kinds), steps.append)
    grown_from = {line.split(" + ")[0] for line in steps if " + " in line}
    assert len(grown_from & set(ALIKE)) == 1
    best = next(h for h in ranked if len(h.effects) == 2)
    known = [*ranked, *prune(best, ranked)]
    others = exchange(best, known, base)
    assert {h.names for h in [*known, *others]} >= {
        tuple(sorted((name, "coulomb_friction"))) for name in ALIKE
    }
    for hypothesis in others:
        assert hypothesis.fit.total == pytest.approx(best.fit.total, rel=0.02)
    assert exchange(best, [*known, *others], base) == []


@pytest.mark.parametrize("offset", [-13.0, slow(6.0)])
def test_an_offset_of_most_of_the_wind_is_found(offset):
    """The slowest wind is 15 m/s."""
    kind = effect_class("wind_speed_offset")
    base = nominal(campaign(effect_from(kind.name, {"offset": offset})))
    found = grow(whole_runs(base, [kind]))[0].fit
    assert within_noise(found)
    assert abs(found.value("wind_speed_offset.offset") - offset) < 4.0 * found.std("wind_speed_offset.offset")


def test_an_effect_taken_out_leaves_the_fit_without_it():
    """With a phase in every run, which goes with its effect."""
    line = effect_from("second_mode", {"amplitude": 0.004, "frequency": 60.0, "damping_ratio": 0.005})
    base = nominal(campaign(line, effect_from("quadratic_damping", {"coefficient": 0.003})))
    ringing = added(base, "second_mode")
    both = added(ringing, "quadratic_damping")
    assert list(both.problem.parameters.own_places) == ["second_mode"]
    pruned = prune(Hypothesis(("second_mode", "quadratic_damping"), both), [])
    (left,) = (one.fit for one in pruned if one.effects == ("quadratic_damping",))
    direct = starting_points(base, effect_class("quadratic_damping"))[0]
    assert left.problem.effects == (effect_class("quadratic_damping"),)
    assert left.point.per_run.shape == base.point.per_run.shape
    assert left.total == pytest.approx(fit(direct.problem, direct.point).total, rel=1e-4)


def test_a_second_mode_is_neither_a_drift_nor_the_motion_itself() -> None:
    rates = (0.6, 6.0, 12.0, 12.3, 14.0, 36.0)
    modes = [effect_from("second_mode", {"amplitude": 0.002, "frequency": rate}) for rate in rates]
    assert [mode.plausible(12.0, 60.0, SWING) for mode in modes] == [False, True, False, False, True, True]


@pytest.mark.parametrize(
    ("duration", "damping", "named"), [(2.0, 0.001, True), (1.6, 0.001, False), (2.0, 0.05, False)]
)
def test_a_mode_near_the_motion_beats_with_it_while_both_last(duration, damping, named) -> None:
    """At 1.8 and 2.1 Hz half a beat takes 1.67 s; a mode of 5 % at 2.1 Hz lasts 1.5 s."""
    mode = effect_from(
        "second_mode", {"amplitude": 0.002, "frequency": 2.0 * np.pi * 2.1, "damping_ratio": damping}
    )
    assert mode.plausible(2.0 * np.pi * 1.8, duration, SWING) == named


def test_a_mode_near_the_motion_of_every_run_is_found() -> None:
    base = nominal(campaign())
    motions = [2.0 * np.pi * resonance(base, i) for i in range(len(base.problem.data.runs))]
    near = 1.12 * float(np.median(motions))
    line = effect_from("second_mode", {"amplitude": 0.004, "frequency": near, "damping_ratio": 0.004})
    (found,) = grow(whole_runs(nominal(campaign(line)), [effect_class("second_mode")]))
    assert within_noise(found.fit)
    assert abs(found.fit.value("second_mode.frequency") - near) < 4.0 * found.fit.std("second_mode.frequency")


def test_a_second_mode_near_the_motion_of_one_spring_is_found_beside_that_of_the_others() -> None:
    base = nominal(campaign())
    motions = sorted({2.0 * np.pi * resonance(base, i) for i in range(len(base.problem.data.runs))})
    near = 1.1 * motions[-1]
    beside = [abs(near / omega - 1.0) > NEAR_MOTION for omega in motions]
    assert not all(beside)
    assert np.mean(beside) >= 0.5
    line = effect_from("second_mode", {"amplitude": 0.004, "frequency": near, "damping_ratio": 0.01})
    (found,) = grow(whole_runs(nominal(campaign(line)), [effect_class("second_mode")]))
    assert within_noise(found.fit)
    assert abs(found.fit.value("second_mode.frequency") - near) < 4.0 * found.fit.std("second_mode.frequency")


def test_of_several_forms_only_those_that_matter_are_freed() -> None:
    """The friction is the textbook's, though it has a form too."""
    friction = effect_from("coulomb_friction", {"friction_moment": 0.003})
    spring = effect_from("asymmetric_stiffness", {"coefficient": -0.2, "exponent": 1.2})
    base = nominal(campaign(friction, spring))
    whole = grow(whole_runs(base, [type(friction), type(spring)]))[0]
    kept = Hypothesis(
        whole.effects, fit(replace(whole.fit.problem, free_forms=()), textbook_point(whole.fit))
    )
    (freed,) = with_forms([kept], misfit(base), 0.0)
    assert freed.fit.problem.free_forms == ("asymmetric_stiffness.exponent",)
    assert freed.textbook is kept.fit
    assert within_noise(freed.fit)


def hypotheses(base: Fit, *names: str) -> list[Hypothesis]:
    """Single effects with their textbook forms, fitted."""
    leads = ((name, starting_points(base, effect_class(name))[0]) for name in names)
    return [Hypothesis((name,), fit(lead.problem, lead.point, base=base)) for name, lead in leads]


def test_forms_are_tried_only_where_they_could_win_and_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Not beside an effect that explains the runs, nor again where they added no weight."""
    base, tried = nominal(campaign(effect_from("coulomb_friction", {"friction_moment": 0.02}))), []
    freeing = module._free_forms
    monkeypatch.setattr(
        module, "_free_forms", lambda fitted, *rest: tried.append(fitted) or freeing(fitted, *rest)
    )
    with_forms(hypotheses(base, "coulomb_friction", "nonlinear_yaw_moment"), misfit(base), 0.0)
    assert not tried
    once = with_forms(hypotheses(base, "nonlinear_yaw_moment"), misfit(base), 0.0)
    assert tried
    assert once[0].plain is once[0].fit
    tried.clear()
    assert with_forms(once, misfit(base), 0.0) == once
    assert not tried


@pytest.mark.parametrize(
    ("form", "freed"),
    [
        slow({"exponent": 0.3}, ("exponent",)),
        slow({"saturation": 0.4}, ("saturation",)),
        slow({"peak": 1.0, "peak_rate": 0.4}, ("peak", "peak_rate")),
        ({"presliding": 0.02}, ("presliding",)),
    ],
    ids=lambda given: next(iter(given)),
)
def test_friction_takes_the_form_that_the_runs_ask_for(form, freed) -> None:
    """One form of several, at its own values."""
    friction = effect_from("coulomb_friction", {"friction_moment": 0.008, **form})
    base = nominal(campaign(friction, duration=10.0))
    (lead,) = starting_points(base, type(friction))
    textbook = Hypothesis(("coulomb_friction",), fit(lead.problem, lead.point, base=base))
    assert not within_noise(textbook.fit)
    (found,) = with_forms([textbook], misfit(base), 0.0)
    assert found.fit.problem.free_forms == tuple(f"coulomb_friction.{name}" for name in freed)
    assert within_noise(found.fit)
    for name, value in form.items():
        full = f"coulomb_friction.{name}"
        assert abs(found.fit.value(full) - value) < max(5.0 * found.fit.std(full), 0.02 * value)


def textbook_point(found: Fit) -> Point:
    problem = replace(found.problem, free_forms=())
    return Point(np.array([found.value(name) for name in problem.names]), found.point.per_run)


def test_a_line_that_does_not_decay_is_no_mode() -> None:
    """A fit to a vibration ends at the least damping allowed."""
    least = next(i for i in effect_class("second_mode").parameters() if i.name == "damping_ratio").fit_lower
    ratios = (least, 1.1 * least, 0.01)
    modes = [
        effect_from("second_mode", {"amplitude": 0.002, "frequency": 36.0, "damping_ratio": r})
        for r in ratios
    ]
    assert [mode.plausible(12.0, 60.0, SWING) for mode in modes] == [False, True, True]


def test_instants_are_sought_again_beside_a_form() -> None:
    """Beside friction without presliding, further instants follow the error of its frequency."""
    friction = effect_from("coulomb_friction", {"friction_moment": 0.003, "presliding": 0.008})
    lost = effect_from("dropped_samples", {"lost_time": 0.002})
    base = nominal(campaign(friction, lost, duration=10.0, conditions=FOUR[::3]))
    found = grow(whole_runs(base, [type(friction), type(lost)]))[0]
    assert found.names == ("coulomb_friction", "dropped_samples")
    assert found.fit.problem.free_forms == ("coulomb_friction.presliding",)
    assert found.fit.problem.instants == 1
    assert within_noise(found.fit)
    assert found.fit.value("dropped_samples.lost_time") == pytest.approx(0.002, rel=0.1)
