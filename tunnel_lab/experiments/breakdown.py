"""The bias that each unmodelled effect causes in each estimator, with its tables and figures.

The campaigns are made by the reference simulator, which shares no numerics with estimators or model. Each has
twelve runs on three springs and one effect in its textbook form. The effect is sized for an excess of the nominal
refit of 1 or 10 noise variances. matplotlib is imported inside the functions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from math import radians
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from identification.estimate import PARAMETERS
from identification.show.blocks import Paragraph, TextTable
from identification.show.numbers import listed, significant
from identification.show.style import figure, styled
from tunnel_lab.experiments.bounds import coefficients_bound
from tunnel_lab.experiments.estimate_rows import counted_failures, not_given
from tunnel_lab.experiments.experiment import RESULTS, Done, Experiment, parquet
from tunnel_lab.experiments.score import ANSWER_COLUMNS, answer_rows
from tunnel_lab.experiments.score_columns import (
    BIAS_IN_STDS,
    BIAS_PERCENT,
    NAMES,
    ScoredRow,
    file_columns,
    not_given_notes,
    trials_of,
)
from tunnel_lab.experiments.score_grid import ScoreTrial
from tunnel_lab.experiments.view import ExperimentView
from tunnel_reference.draw import CampaignDraw, EffectDraw
from tunnel_reference.forms import forms_of
from tunnel_reference.in_phase import in_phase
from tunnel_reference.make import as_campaign
from tunnel_reference.severity import read_and_fit, simulate_motions, size_effects
from tunnel_reference.true_conditions import TrueConditions
from tunnel_sim.effects import ALL_EFFECTS, BetweenRuns
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import Truth

if TYPE_CHECKING:
    from matplotlib.figure import Figure


NOTHING_ADDED = "no effect"
SEVERITIES = (1.0, 10.0)
"""Mean squared residual of the nominal refit over the noise variance, minus one."""
EFFECTS: tuple[str, ...] = tuple(
    kind.name for kind in ALL_EFFECTS if not (kind.driven or issubclass(kind, BetweenRuns))
)
REALISATIONS = 3
TRUTH = Truth(cn_beta=0.49, cn_r=-0.11, yaw_inertia=0.1014, mechanical_damping=0.012)
NOISE = 5e-4  # rad

_CASE_COLUMNS: Mapping[str, Any] = {
    "effect": pl.String,
    **dict.fromkeys(("severity", "reached"), pl.Float64),
    "realisation": pl.Int64,
}
_SPRINGS, _SPEEDS = (16.12, 35.02, 51.88), (0.0, 15.0, 25.0)
_DENSITY = 1.204
_RUNS = (
    *((spring, speed, 20.0) for spring in _SPRINGS for speed in _SPEEDS),
    (16.12, 0.0, 8.0),
    (16.12, 25.0, 8.0),
    (35.02, 20.0, 14.0),
)  # N m/rad, m/s, degrees
SHOWN = ("cn_beta", "cn_r")
ABOUT = (
    "Bias in % of the truth; in brackets in reported standard deviations. Severity: excess mean squared residual "
    "after the nominal refit, in noise variances."
)
_SIDE_BY_SIDE = 3  # estimators in a table for 80 columns
_DECADES = 2.0  # decades of standard deviations above one, at the ends of the colours
_DARK = 1.2  # number of decades above which white text is legible


@dataclass(frozen=True, eq=False)
class BiasCase:
    """A campaign under one effect, or none.

    Args:
        effect: name of the effect, or ``no effect``.
        severity: target excess, in noise variances (a ratio); 0 for no effect.
        reached: excess after the reference simulator's nominal refit, in noise variances (a ratio).
        realisation: number of the realisation, from 0.
    """

    effect: str
    severity: float
    reached: float
    realisation: int
    trial: ScoreTrial


def conditions_of(seed: int, *, duration: float = 10.0) -> TrueConditions:
    """The campaign to which the effects are added.

    Args:
        seed: seed of the actual release angles.
        duration: duration of every run, s.
    """
    springs, speeds, degrees = (np.array(column) for column in zip(*_RUNS, strict=True))
    release = np.round(np.radians(degrees), 4)
    start = release * (1.0 + 0.03 * np.random.default_rng(seed).standard_normal(release.size))
    return TrueConditions(
        spring_stiffness=springs, wind_speed=speeds, release_angle=release, start_angle=start,
        air_density=_DENSITY, duration=duration, noise_std=NOISE, zero=radians(0.2),
        **vars(TRUTH),
    )  # fmt: skip


def make_cases(
    seed: int,
    *,
    realisations: int = REALISATIONS,
    effects: Sequence[str] = EFFECTS,
    severities: Sequence[float] = SEVERITIES,
    duration: float = 10.0,
    show_steps: bool = False,
) -> list[BiasCase]:
    """Size the effects and simulate their campaigns.

    Realisations differ in the noise and in random forcing. Effects with a sign are positive. The campaign without
    effect comes first; the others are ordered by effect, severity and realisation.

    Args:
        severities: target excesses after the nominal refit, in noise variances (ratios).
        duration: duration of every run, s.
        show_steps: whether to show the progress of sizing on standard error.
    """
    conditions = conditions_of(seed, duration=duration)
    nothing = CampaignDraw("none", conditions, (), 0)
    sized = size_effects(
        [draw_effect(conditions, name, severity, seed) for name in effects for severity in severities],
        progress=show_steps,
    )
    several = [realised(draw, i, seed) for draw in (nothing, *sized) for i in range(realisations)]
    # a motion without random forcing is integrated once
    moving = [draw for i, draw in enumerate(several) if i % realisations == 0 or _random(draw)]
    motions = iter(simulate_motions(moving))
    cases = []
    motion = None
    for i, draw in enumerate(several):
        if motion is None or i % realisations == 0 or _random(draw):
            motion = next(motions)
        simulated = read_and_fit(draw, motion)
        campaign = as_campaign(simulated, "breakdown")
        starts, noise = draw.conditions.start_angle.tolist(), float(np.sqrt(draw.conditions.noise_power))
        cases.append(
            BiasCase(
                effect=draw.effects[0].form.family if draw.effects else NOTHING_ADDED,
                severity=draw.effects[0].target if draw.effects else 0.0,
                reached=simulated.excess,
                realisation=i % realisations,
                trial=ScoreTrial(
                    campaign,
                    truth=vars(TRUTH) | (in_phase(draw) or {}),
                    bound=coefficients_bound(campaign, TRUTH, starts, noise),
                ),
            )
        )
    return cases


def draw_effect(conditions: TrueConditions, name: str, severity: float, seed: int) -> CampaignDraw:
    """A campaign with one effect in its textbook form.

    Args:
        severity: target excess, in noise variances (a ratio).
    """
    form = forms_of(name)[0]
    rng = np.random.default_rng([seed, EFFECTS.index(name)])
    extra = {key: float(value) for key, value in form.draw(rng, conditions).items()}
    effect = EffectDraw(form, extra, max(form.signs), severity, form.start)
    return CampaignDraw("single", conditions, (effect,), seed)


def _random(draw: CampaignDraw) -> bool:
    return any("seed" in effect.extra for effect in draw.effects)


def realised(draw: CampaignDraw, number: int, seed: int) -> CampaignDraw:
    """The same case with other noise and other random forcing."""
    name = draw.effects[0].form.family if draw.effects else NOTHING_ADDED
    key = EFFECTS.index(name) if draw.effects else len(EFFECTS)
    rng = np.random.default_rng([seed, key, number, 1])
    noise = int(rng.integers(2**62))
    effects = draw.effects
    if _random(draw) and number > 0:
        other = {"seed": float(rng.integers(0, 2**31))}
        effects = tuple(replace(effect, extra=effect.extra | other) for effect in effects)
    return replace(draw, effects=effects, seed=noise)


def breakdown_of(cases: Sequence[BiasCase], estimators: tuple[str, ...], seed: int) -> Experiment[BiasCase]:
    """Run estimators on every case; the results have a row of `ANSWER_COLUMNS` for each quantity.

    Args:
        seed: seed of the cases.
    """
    return Experiment(
        "breakdown",
        cases,
        partial(_estimate_case, estimators),
        case_name,
        {"cases": list(map(case_name, cases)), "seed": seed, "estimators": list(estimators)},
        estimators,
        elsewhere="name another --out, or add --overwrite",
        code_matters=True,
    )


def case_name(case: BiasCase) -> str:
    """Effect, severity and realisation."""
    return f"{case.effect.replace(' ', '_')}-{case.severity:g}-{case.realisation}"


def _estimate_case(estimators: Sequence[str], case: BiasCase) -> Done:
    rows, failed = [], []
    for name in estimators:
        answer, failure = answer_rows(name, case.trial)
        rows += [(case.effect, case.severity, case.reached, case.realisation, *row) for row in answer]
        failed += failure
    columns = {**_CASE_COLUMNS, **ANSWER_COLUMNS, "message": pl.String}
    return Done({RESULTS: parquet(rows, columns)}, counted_failures(failed))


def breakdown_frame(results: pl.DataFrame) -> pl.DataFrame:
    """The biases that each effect causes: a row for each effect, severity, estimator and quantity.

    Quantities that an estimator does not give are left out. Units are in the names of the columns.
    """
    absent = not_given(results)
    keys = ("effect", "severity", "estimator", "quantity")
    columns = {"bias_percent": BIAS_PERCENT, "bias_in_stds": BIAS_IN_STDS}
    rows = []
    for (effect, severity, estimator, quantity), some in results.group_by(*keys, maintain_order=True):
        if quantity in absent.get(str(estimator), ()):
            continue
        row = ScoredRow(str(estimator), str(quantity), (trials_of(some),))
        rows.append(
            {
                "effect": effect,
                "severity_noise_powers": severity,
                "reached_noise_powers": some["reached"].mean(),
                "estimator": estimator,
                "quantity": quantity,
                "realisations": row.failures.total,
                "failures": row.failures.count,
                **file_columns(row, columns, "_std_error"),
                "rmse_over_bound": getattr(row.rmse_over_bound, "value", None),
                "covered": getattr(row.coverage, "count", None),
                "model_departs_share": (some["status"] == "model_departs").mean(),
            }
        )
    return pl.DataFrame(rows, infer_schema_length=None)


def breakdown_view(results: pl.DataFrame) -> ExperimentView:
    """The view of a breakdown.

    Args:
        results: results of `breakdown_of`.
    """
    frame = breakdown_frame(results)
    if frame.is_empty():
        what = f"the estimators give none of {listed(list(PARAMETERS))}, whose bias a breakdown shows"
        raise TunnelError(what, remedy="name one that does, such as output_error")
    given = [quantity for quantity in SHOWN if quantity in set(frame["quantity"])]
    tables = [one for quantity in given for one in breakdown_tables(frame, quantity)]
    return ExperimentView(
        "Bias caused by each unmodelled effect",
        [*tables, Paragraph(ABOUT), *not_given_notes(not_given(results))],
        {f"breakdown-{one.replace('_', '-')}": partial(breakdown_figure, frame, one) for one in given},
        {"breakdown.parquet": parquet(frame)},
    )


def breakdown_tables(frame: pl.DataFrame, quantity: str) -> list[TextTable]:
    """The bias of one quantity, with effects in rows and estimators in columns, three to a table."""
    mine = frame.filter(pl.col("quantity") == quantity)
    estimators = mine["estimator"].unique(maintain_order=True).to_list()
    cells, places = {}, ("effect", "severity_noise_powers")
    for row in mine.iter_rows(named=True):
        text = "failed" if row["failures"] else "–"
        if row["bias_percent"] is not None:
            deviations = "–" if row["bias_in_stds"] is None else _compact(row["bias_in_stds"])
            text = f"{_compact(row['bias_percent'])} ({deviations}σ)"
        cells[row["effect"], row["severity_noise_powers"], row["estimator"]] = text
    tables = []
    for first in range(0, len(estimators), _SIDE_BY_SIDE):
        some = estimators[first : first + _SIDE_BY_SIDE]
        rows = tuple(
            (effect, f"{severity:g}" if severity else "", *(cells[effect, severity, name] for name in some))
            for effect, severity in mine.select(places).unique(maintain_order=True).iter_rows()
        )
        title = f"Bias of {NAMES[quantity]} [%]"
        tables.append(TextTable(title, ("effect", "×", *some), rows, right=("×", *some), names=("effect",)))
    return tables


def _compact(value: float) -> str:
    """Two digits and a sign."""
    size = abs(value)
    text = significant(size, 2) if 1e-3 <= size < 1e4 else f"{size:.0e}" if size else "0"
    return f"{'−' if value < 0 else '+'}{text}"


@styled
def breakdown_figure(frame: pl.DataFrame, quantity: str) -> Figure:
    """The biases of one quantity that exceed one reported standard deviation.

    Effects are in rows and estimators in columns, each with its severities side by side. The colour is the bias in
    reported standard deviations, the number the bias in %; cells of smaller biases are empty.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.patches import Rectangle

    cells = exceeding(frame, quantity)
    mine = frame.filter(frame["quantity"] == quantity)
    effects, names = (mine[key].unique(maintain_order=True).to_list() for key in ("effect", "estimator"))
    severities = sorted(set(mine["severity_noise_powers"]) - {0.0})
    fig = figure(1.6 + 0.42 * len(names) * max(len(severities), 2), 1.3 + 0.2 * len(effects))
    axes = fig.add_subplot()
    colours = ScalarMappable(Normalize(-_DECADES, _DECADES), "RdBu_r")
    for (effect, severity, name), (percent, stds) in cells.items():
        width = 1.0 / len(severities) if severity else 1.0
        place = severities.index(severity) * width if severity else 0.0
        shade = float(np.sign(stds) * np.log10(abs(stds)))
        corner = (names.index(name) + place, effects.index(effect) - 0.5)
        axes.add_patch(
            Rectangle(corner, width, 1.0, color=colours.to_rgba(np.array([shade]))[0], linewidth=0.0)
        )
        axes.text(
            corner[0] + 0.5 * width, effects.index(effect), _compact(percent), ha="center", va="center",
            fontsize=6, color="white" if abs(shade) > _DARK else "black",
        )  # fmt: skip
    for edge in range(1, len(names)):
        axes.axvline(edge, color="0.75", linewidth=0.6)
    for edge in range(1, len(effects)):
        axes.axhline(edge - 0.5, color="0.9", linewidth=0.4, zorder=0)
    labels = [name.replace("_", "\n") for name in names]
    axes.set_xticks(np.arange(len(names)) + 0.5, labels)
    axes.set_yticks(range(len(effects)), [effect.replace("_", " ") for effect in effects])
    axes.set(xlim=(0.0, len(names)), ylim=(len(effects) - 0.5, -0.5))
    axes.tick_params(length=0)
    each = ", ".join(f"{severity:g}" for severity in severities)
    axes.set_title(
        f"Bias of {NAMES[quantity]} in % where it exceeds one σ; from left to right: {each} × noise variance"
    )
    bar = fig.colorbar(colours, ax=axes, location="bottom", aspect=60, shrink=0.6)
    bar.set_ticks([-2, -1, 0, 1, 2], labels=["≤ −100", "−10", "±1", "10", "≥ 100"])
    bar.set_label("bias in reported standard deviations σ")
    return fig


def exceeding(frame: pl.DataFrame, quantity: str) -> dict[tuple[str, float, str], tuple[float, float]]:
    """Biases that are larger than one reported standard deviation, by effect, severity and estimator.

    Returns:
        The bias in % of the truth and in reported standard deviations; severities in noise variances (ratios).
    """
    cells = {}
    for row in frame.filter(frame["quantity"] == quantity).iter_rows(named=True):
        percent, stds = row["bias_percent"], row["bias_in_stds"]
        if percent is not None and stds is not None and abs(stds) > 1.0:
            cells[row["effect"], row["severity_noise_powers"], row["estimator"]] = (percent, stds)
    return cells


def packaged_breakdown() -> pl.DataFrame:
    """Results of ``tunnel score --breakdown``; columns as in its Parquet file."""
    with resources.as_file(resources.files("tunnel_lab") / "data" / "score-breakdown.parquet") as path:
        return pl.read_parquet(path)
