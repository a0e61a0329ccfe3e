"""The explainable share of a gap, and the proposed law; the reference simulator gives the truth."""

from __future__ import annotations

from dataclasses import asdict, replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import tomli_w
from scipy.signal import lfilter

from diagnosis import diagnose
from diagnosis.findings.terms import KINDS
from diagnosis.likelihood.ceiling import (
    Ceiling,
    Evidence,
    Unexplained,
    best_ridge,
    held_out,
    normal,
    ratio,
    total,
)
from diagnosis.likelihood.least_squares import fit
from diagnosis.likelihood.paths import paths, ranges
from diagnosis.likelihood.residuals import linear_coefficients
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.remainder import ways
from diagnosis.remainder.explain import chosen_kind, closable, steady_line
from diagnosis.remainder.formula import Formula, FormulaTerm, choose, effect_of, effect_table, terms
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.investigate import investigate
from diagnosis.settings import Settings
from tests.marks import slow
from tests.reference.rigs import rig
from tests.support.diagnosis_document import findings_of
from tests.support.gap_campaigns import answer, campaign, nominal
from tests.support.rendered import closable_line, closable_table, closable_words
from tunnel_lab.commands.diagnose import write_proposal
from tunnel_reference.draw import CampaignDraw, EffectDraw
from tunnel_reference.make import as_campaign
from tunnel_reference.outside import LAW_FORMS, OUTSIDE_FORMS
from tunnel_reference.severity import read_and_fit, simulate_motions
from tunnel_sim.effects import effect_class
from tunnel_sim.effects.expression_effect import read_effects
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.dimensions import dimension, dimension_text

RUNS = rig(
    stiffness=(21.02, 21.02, 45.0, 45.0, 21.02, 45.0),
    speed=(0.0, 20.0, 0.0, 20.0, 0.0, 20.0),
    angle=(0.35, 0.35, 0.35, 0.35, 0.2, 0.25),
    duration=6.0,
    sample_rate=500.0,
)
FORMS = {form.name: form for form in (*OUTSIDE_FORMS, *LAW_FORMS)}


def study_of(name, value, conditions=RUNS, settings=Settings(), **extra):
    effects = () if not name else (EffectDraw(FORMS[name], extra, 1, 1.0, value),)
    draw = CampaignDraw("law", conditions, effects, 5)
    (motion,) = simulate_motions([draw], fine=False)
    return investigate(as_campaign(read_and_fit(draw, motion), name or "plain"), (), settings=settings)


def test_a_run_of_too_few_blocks_for_a_row_says_nothing_of_what_could_be_closed(detent):
    study, _ = detent
    nominal = study.prepared.tested
    first, *others = nominal.problem.data.runs
    short = nominal.problem.data.with_runs((first.part(0, 4), *others))
    fitted = fit(replace(nominal.problem, data=short), nominal.point)
    assert fitted.excess > 0.0
    assert min(path.residual.size for path in paths(fitted)) == 0
    shorter = replace(study, prepared=replace(study.prepared, nominal=fitted))
    assert closable(shorter, significant=True, decided=False) is None


@pytest.fixture(scope="module")
def detent():
    study = study_of("magnetic_detent", 0.01, width=0.05)
    return study, closable(study, significant=True)


def closed(found):
    return {one.kind: one.closed for one in found.ceilings}


def test_a_moment_of_the_angle_is_seen_as_one(detent):
    _, found = detent
    assert found.kind == "angle"
    assert closed(found)["angle"] > 0.95
    assert max(closed(found)[kind] for kind in ("rate", "time", "wind", "reading", "between")) < 0.9


def test_its_curve_is_the_missing_moment(detent):
    _, found = detent
    (angle,) = map(np.array, found.curve.places)
    missing = 0.01 * angle / 0.05 * np.exp(0.5 - 0.5 * (angle / 0.05) ** 2)
    line = np.column_stack([np.ones(angle.size), angle])
    missing -= line @ np.linalg.lstsq(line, missing, rcond=None)[0]
    assert found.curve.over == ("angle",)
    assert found.curve.unit == "N m"
    # the runs never turn within 0.1 rad: there they show little more than the mean
    values, std = np.array(found.curve.values), np.array(found.curve.std)
    turned = (np.abs(angle) > 0.1) & (np.abs(angle) < 0.33)
    assert np.all(np.abs(values - missing)[turned] < 4.0 * std[turned])
    assert np.corrcoef(values, missing)[0, 1] > 0.9


def test_its_formula_closes_held_out_runs_and_is_an_effect_of_a_file(detent, tmp_path):
    study, found = detent
    assert found.law.closed > 0.97
    path = write_proposal(tmp_path / "law.toml", findings_of({"closable": as_json(found)}))
    (kind,) = read_effects(path)
    assert kind.name == "proposed_angle"
    assert study.similarity.moment == pytest.approx(16.0 / 33.01, rel=0.1)  # so its units did change
    effect = kind(**{name: value for name, (value, _) in found.law.parameters.items()})
    nominal = study.nominal
    stated = nominal.problem.stated(nominal.point.common, np.zeros(2), nominal.problem.data.runs[0])
    moment = effect.moment_oracle(replace(stated, spring_stiffness=21.02))
    true = 0.01 * 0.6 * np.exp(0.5 - 0.5 * 0.36)
    assert moment(0.0, 0.03, 0.0) - 3.0 * moment(0.0, 0.01, 0.0) == pytest.approx(
        true - 3.0 * 0.01 * 0.2 * np.exp(0.5 - 0.5 * 0.04), rel=0.1
    )


@pytest.mark.slow
def test_the_share_of_a_single_run_is_of_what_its_stretches_show():
    alone = rig(stiffness=(21.02,), speed=(0.0,), angle=(0.35,), duration=10.0, sample_rate=500.0)
    found = closable(study_of("stops", 0.8, alone, place=0.15), significant=True)
    assert {one.held_out for one in found.ceilings} == {"stretches of time", "short gaps"}
    assert found.kind == "angle"
    assert closed(found)["angle"] > 0.85


def test_a_term_about_zero_is_an_effect_of_a_file():
    """Its centre may be fitted, which needs a typical value other than 0."""
    centred = Formula(
        (FormulaTerm("max(b-c,0)", {"c": 0.0}),), (-2.0,), of_reading=False, delta=np.zeros(5), gained=9.0
    )
    kind = effect_of(effect_table(centred, "beyond_the_centre"))
    assert [(info.default, info.scale != 0.0) for info in kind.parameters()] == [(0.0, True), (0.0, True)]


def test_what_differs_in_one_run_is_placed_in_it():
    never = Settings().changed({"selection.disturbed_rate": 0.0})  # the run is left out otherwise
    study = study_of("bump_one_run", 0.008, settings=never, run=2.0, part=0.5, width=0.05)
    found = closable(study, significant=True)
    assert found.kind == "event"
    assert found.law is None
    first = found.events[0]
    assert first["run"] == "r03"
    assert first["from_s"] == pytest.approx(3.0, abs=0.4)
    assert first["to_s"] == pytest.approx(3.0, abs=0.4)


def test_runs_that_differ_by_chance_are_no_error_of_the_reading_alike_in_all():
    """Truth: the time of every run is stretched by its own share, so that no law of all runs exists."""
    rng, data = np.random.default_rng(5), campaign(duration=6.0)
    runs = []
    for run in data.runs:
        time = run.record.time_s
        stretched = np.interp(time * (1.0 + rng.normal(0.0, 1e-3)), time, run.record.yaw_rad)
        runs.append(replace(run, record=replace(run.record, yaw_rad=stretched)))
    unexplained = Unexplained(nominal(replace(data, runs=tuple(runs))))
    reading, between = unexplained.common("reading"), unexplained.single("between")
    assert between.ceiling.closed > 0.95
    assert reading.ceiling.closed < 0.5
    assert chosen_kind({"reading": reading}, {"between": between}) == "between"


def test_a_vibration_is_a_steady_line():
    study = study_of("platform_vibration", 0.05, frequency=7.2, seed=3.0)
    found = closable(study, significant=True)
    assert found.kind == "line"
    assert found.law is None
    assert closed(found)["line"] > 0.95
    assert len(found.events) == RUNS.spring_stiffness.size
    change, line = study.similarity, steady_line(Unexplained(study.nominal))
    frequency, std = change.own(line.frequency, "Hz"), change.own(line.frequency_std, "Hz")
    assert std < 0.005
    assert frequency == pytest.approx(7.2, abs=4.0 * std)
    # above its resonance the rig answers with M/|K - I w^2|: damping and air change that by less than a per cent
    still = 0.05 / np.abs(RUNS.spring_stiffness - RUNS.yaw_inertia * (2.0 * np.pi * 7.2) ** 2)
    assert line.amplitude == pytest.approx(np.sqrt(np.mean(still**2)), rel=0.03)
    assert (found.line.frequency_hz, found.line.frequency_std_hz, found.line.unit) == (frequency, std, "rad")
    assert found.line.amplitude == change.own(line.amplitude, "rad")


def test_what_does_not_keep_its_phase_is_not_a_line(detent):
    """Residuals made here: white noise, a resonance driven by noise, and a sinusoid, in a closed form."""
    fit, rng = detent[0].prepared.tested, np.random.default_rng(1)
    turn = 2.0 * np.pi * 7.0 * fit.problem.data.runs[0].interval
    radius = np.exp(-turn / 60.0)

    def ringing(size):
        found = lfilter(
            [1.0], [1.0, -2.0 * radius * np.cos(turn), radius**2], rng.standard_normal(size + 2000)
        )
        return 2.0 * found[2000:] / found.std()

    def sinusoid(size):
        return 0.4 * np.sin(turn * np.arange(size) + rng.uniform(0.0, 2.0 * np.pi))

    lines = []
    for shape in (np.zeros, ringing, sinusoid):
        residuals = tuple(shape(r.size) + rng.standard_normal(r.size) for r in fit.residuals)
        lines.append(steady_line(Unexplained(replace(fit, residuals=residuals))))
    assert lines[:2] == [None, None]
    assert lines[2].frequency == pytest.approx(7.0, abs=4.0 * lines[2].frequency_std)
    noise = np.sqrt(np.mean([run.noise.variance for run in fit.problem.data.runs]))
    assert lines[2].amplitude == pytest.approx(0.4 * noise, abs=4.0 * lines[2].amplitude_std)


def test_more_noise_cannot_be_closed():
    found = closable(study_of("motion_noise", 0.03), significant=True)
    assert found is None or (found.kind == "noise" and found.law is None)


def test_nothing_is_proposed_without_a_gap(tmp_path):
    study = study_of("", 0.0)
    assert closable(study, significant=False) is None
    assert write_proposal(tmp_path / "law.toml", findings_of({"closable": None})) is None
    assert not (tmp_path / "law.toml").exists()
    assert closable_table(findings_of({"closable": None})).rows == ()


REST = {"significant": False, "p_value": 0.4321}


@pytest.mark.parametrize(
    ("causes", "rest", "said"),
    [
        (
            ["coulomb_friction"],
            REST,
            "What could explain the residual gap: nothing beyond chance (p = 0.43).",
        ),
        (["coulomb_friction"], REST | {"significant": True}, ""),
        (
            ["buffeting"],
            REST | {"significant": True},
            "What could explain the residual gap: not stated, since any law",
        ),
        ([], REST, ""),
        (["unknown"], None, ""),
    ],
)
def test_beside_every_named_answer_it_says_what_could_be_closed(causes, rest, said):
    words = closable_line(findings_of({"closable": None, "causes": causes, "rest": rest}))
    assert words.startswith(said)
    assert bool(words) == bool(said)


def _singular(*_, **__):
    raise np.linalg.LinAlgError


def _running_away(*_, **__):
    return np.full(2, 1e300) @ np.full(2, 1e300)


@pytest.mark.parametrize("unsolvable", [_singular, slow(_running_away)])
def test_equations_that_cannot_be_solved_are_said(monkeypatch, unsolvable):
    monkeypatch.setattr(ways, "closable", unsolvable)
    found = diagnose(campaign(), kinds=[effect_class("coulomb_friction")])
    assert found.closable is None
    assert any("was not found" in caution for caution in found.cautions)


def test_the_table_names_every_kind(detent):
    _, found = detent
    document = {"closable": as_json(found)}
    assert {row[0] for row in closable_table(findings_of(document)).rows} == {
        text for kind, text in KINDS.items() if kind not in ("noise", "line")
    }
    words = closable_words(findings_of(document | {"causes": ["unknown"], "decided": True}))
    assert f"{closable_table(findings_of(document)).rows[0][0].capitalize()} could explain " in words


def test_a_steady_moment_turns_the_rig_as_the_closed_form_says(detent):
    path = paths(detent[0].nominal)[0]
    inertia, damping, stiffness = linear_coefficients(path.fit, 0)
    sigma = damping / (2.0 * inertia)
    omega = np.sqrt(stiffness / inertia - sigma**2)
    step = path.run.interval * path.group
    time = step * np.arange(path.residual.size)
    wave = np.cos(omega * time) + sigma / omega * np.sin(omega * time)
    turned = (1.0 - np.exp(-sigma * time) * wave) / stiffness
    whole = path.response(np.ones((path.angle.size, 1)))[:, 0]
    released = turned * np.sqrt(path.group / path.run.noise.variance)
    # it may set in within the first row: the free motion after that is the release's
    found, expected = (one - path.release @ (path.release.T @ one) for one in (whole, released))
    assert found == pytest.approx(expected, abs=2e-3 * np.max(np.abs(expected)))


def test_the_prior_shrinks_what_is_noise_and_keeps_what_is_not():
    rng = np.random.default_rng(3)
    parts = []
    for _ in range(8):
        free, basis = rng.standard_normal((200, 2)), rng.standard_normal((200, 30))
        parts.append(normal(5.0 * free[:, 0] + basis[:, 4] + rng.standard_normal(200), basis, free))
    ridge = best_ridge(total(parts))
    assert ridge.solution[0] == pytest.approx(5.0, abs=0.2)
    assert ridge.solution[2 + 4] == pytest.approx(1.0, abs=0.15)
    groups = [(i,) for i in range(8)]
    alone, with_basis = (held_out(parts, groups, precision).sum() for precision in (None, ridge.precision))
    assert with_basis == pytest.approx(1600.0, rel=0.08)
    assert alone - with_basis == pytest.approx(1600.0, rel=0.2)


def evidence(kind, share, std=0.001):
    return Evidence(Ceiling(kind, share, std, "runs"), 0.0, 1.0)


@pytest.mark.parametrize("quantity", ["angle", "rate"])
@pytest.mark.parametrize("stated", [True, False])
def test_responses_along_the_path_are_the_fits_own_sensitivities_where_the_model_is_right(quantity, stated):
    """Beside the release, which both leave free; 1 %: the fit's motion is in blocks, and the path is smoothed.

    The derivative of a rate departs from −ω² times the angle by 2ζ, which the path of a rate leaves out.
    """
    data = campaign(quantity=quantity)
    if not stated:
        data = replace(data, runs=tuple(replace(run, spring_stiffness=None) for run in data.runs[:1]))
    base = nominal(data)
    for index, path in enumerate(paths(base)):
        inertia, damping, stiffness = linear_coefficients(base, index)
        limit = 0.01 + (damping / np.sqrt(inertia * stiffness) if quantity == "rate" else 0.0)
        both = path.nominal, path.rows(base.jacobian[index][0])
        found, expected = (values - path.release @ (path.release.T @ values) for values in both)
        for one, other in zip(found.T, expected.T, strict=True):
            assert np.linalg.norm(one - other) <= limit * np.linalg.norm(other)


@pytest.mark.parametrize(
    ("kind", "own", "wider", "chosen"),
    [
        (
            "angle",
            9.9,
            20.0,
            "own",
        ),  # it reaches nearly all that its kind closes: no terms of the state are tried
        ("angle", 3.0, 4.0, "wider"),
        ("rate", 3.0, 3.0, "own"),
        ("rate", 3.0, 2.0, "own"),
        ("angle", 3.0, None, "own"),
        ("angle", None, 4.0, "wider"),
        ("angle", None, None, None),
        ("time", 3.0, 4.0, "own"),
    ],
)
def test_terms_of_the_state_are_taken_where_those_of_angle_or_rate_close_less(
    monkeypatch, kind, own, wider, chosen
):
    found = {kind: own, "state": wider}
    formulas = {
        name: None if gained is None else Formula((), (), False, np.zeros(0), gained)
        for name, gained in found.items()
    }
    monkeypatch.setattr("diagnosis.remainder.formula._chosen", lambda _, of, __: formulas[of])
    expected = {"own": formulas[kind], "wider": formulas["state"], None: None}[chosen]
    unexplained = SimpleNamespace(fit=SimpleNamespace(settings=Settings()))
    assert choose(unexplained, kind, 10.0) is expected


def test_the_share_closed_is_a_ratio_of_sums_with_its_standard_error():
    """Where as much was left in every unit: the mean of the drops over it, and that mean's standard error."""
    drop = np.array([3.0, 5.0, 4.0, 8.0])
    closed, std = ratio(drop, np.full(4, 10.0))
    assert closed == pytest.approx(drop.mean() / 10.0)
    assert std == pytest.approx(drop.std(ddof=1) / np.sqrt(4.0) / 10.0)
    assert ratio(drop, 2.0 * drop) == pytest.approx((0.5, 0.0))  # the same share of every unit: no scatter
    assert ratio(np.array([3.0]), np.array([10.0])) == pytest.approx((0.3, 0.0))


@pytest.mark.parametrize(
    ("common", "single", "kind"),
    [
        ({"angle": 0.95, "state": 0.96}, {"event": 0.97}, "angle"),
        ({"angle": 0.60, "state": 0.96}, {"event": 0.97}, "state"),
        ({"angle": 0.10, "state": 0.20}, {"event": 0.97}, "event"),
        ({"angle": 0.01, "state": 0.02}, {"event": 0.03}, "noise"),
    ],
)
def test_the_simplest_kind_that_closes_as_much_is_chosen(common, single, kind):
    given = [{name: evidence(name, share) for name, share in kinds.items()} for kinds in (common, single)]
    assert chosen_kind(*given) == kind


def test_a_kind_whose_share_is_not_determined_is_not_chosen():
    common, single = {"angle": evidence("angle", 1.0, std=0.9)}, {"event": evidence("event", 0.6, std=0.1)}
    assert chosen_kind(common, single) == "event"
    assert chosen_kind(common, {}) is None
    assert chosen_kind(common, {"event": evidence("event", 0.01)}) is None
    rest = {"kind": "angle", "ceilings": [asdict(common["angle"].ceiling)]}
    table = closable_table(findings_of({"closable": rest}))
    assert table.rows[0][1] == "not determined"


@pytest.mark.parametrize("kind", ["angle", "rate", "state", "wind", "time", "reading"])
def test_every_term_has_a_unit_and_a_value(kind, detent):
    r = ranges(paths(detent[0].nominal))
    places = {"b": 0.1, "y": 0.1, "r": 1.0, "t": 2.0, "V": 20.0, "Kr": 21.0, "omega": 14.0}
    for term in terms(kind, r):
        assert np.isfinite(term.value(places))
        assert dimension(dimension_text(term.dimension)) == term.dimension


def test_a_proposed_file_is_plain_toml(detent, tmp_path: Path):
    _, found = detent
    text = tomli_w.dumps({"effects": [dict(found.law.effect)]})
    (tmp_path / "law.toml").write_text(text)
    assert [kind.name for kind in read_effects(tmp_path / "law.toml")] == ["proposed_angle"]


def test_the_formula_for_an_undecided_answer_starts_from_the_nominal_model(detent):
    study, found = detent
    nominal, name = study.nominal, "cubic_stiffness"
    (point, *_) = starting_points(nominal, effect_class(name))
    hypothesis = Hypothesis((name,), fit(point.problem, point.point, base=nominal, max_iterations=2))
    likely = replace(study, answers=(answer((name,), 0.5, 0.4, hypothesis.fit),))
    assert likely.chosen is hypothesis.fit
    undecided = closable(likely, significant=True, decided=False)
    assert as_json(undecided) == as_json(found)
    assert closable(likely, significant=True).excess < found.excess
