"""Policies compared over many seeds: ``python -m docs.studies.campaign_policies docs`` writes the page's figures.

Both policies of a preset play the same seeds: the same truth, and in the i-th run the same noise. Medians have
distribution-free 95 % intervals from order statistics (David & Nagaraja, Order Statistics, 3rd ed. (2003), ch. 7,
doi 10.1002/0471722162); intervals of the difference use the differences seed by seed.
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from scipy.stats import binom

from docs.studies.page_text import replaced
from docs.studies.policies import POLICIES, Policy, run_campaign
from identification.estimate import PARAMETERS
from identification.show.style import COLOURS, MARKERS, WIDTH, figure, grid, log_axis, save, styled
from identification.statistics import Proportion
from tunnel_lab.envs.campaign import CampaignEnv, reached
from tunnel_lab.envs.session import answers, probabilities
from tunnel_lab.experiments.experiment import RESULTS, Done, Experiment, parquet, results_of
from tunnel_lab.experiments.runner import crew
from tunnel_lab.terminal.progress import bar
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CONTESTS = {"identification": ("scripted", "greedy"), "diagnosis": ("scripted", "separating")}
SEEDS = {"identification": 50, "diagnosis": 50}
ARGUMENTS: dict[str, dict[str, Any]] = {
    "identification": {"simulation": "full"},
    "diagnosis": {
        "severities": {"cubic_stiffness": (0.2, 0.4), "nonlinear_yaw_moment": (4.0, 8.0)},
        "noise_std": 0.015,
        "max_runs": 8,
    },
}
"""Settings of the environments; two rivals instead of four, and so much noise that one run is not enough."""
_CONFIDENCE = 0.95
_COLOUR = {"scripted": 0, "greedy": 1, "separating": 2}
_GOAL = 0.05  # relative standard deviation of Cnr at which an identification ends


@dataclass(frozen=True)
class Row:
    """One episode.

    Args:
        runs: number of runs until the goal, or until the episode was cut off.
        rig_time_s: rig time until the goal, or until the episode was cut off, s.
        reached: whether the goal was reached.
        on_first: whether it was reached with the first run.
        right: whether the answer is the acting effect; for an identification, whether Cnβ and Cnr are both
            within three standard deviations of the truth.
        cn_beta_error: error of Cnβ over its standard deviation (1); for an identification.
        cn_r_error: error of Cnr over its standard deviation (1); for an identification.
    """

    preset: str
    policy: str
    seed: int
    runs: int
    rig_time_s: float
    reached: bool
    on_first: bool
    right: bool
    cn_beta_error: float
    cn_r_error: float


def play(preset: str, policy: str, seed: int, use: Policy | None = None) -> Row:
    """Play one episode.

    Args:
        policy: name of the policy in the row.
        use: the policy; None: the policy of this name in `POLICIES`.
    """
    env = CampaignEnv(preset=preset, expose_truth=True, **ARGUMENTS[preset])
    info = run_campaign(env, POLICIES[policy] if use is None else use, seed=seed)
    known, truth = env.known, info["truth"]
    done = reached(known, env.targets, env.probability)
    exact = np.array([truth[name] for name in PARAMETERS])
    error = (known.belief.values - exact) / np.sqrt(np.diag(known.belief.covariance))
    right = bool(np.all(np.abs(error[:2]) < 3.0))
    if preset == "diagnosis":
        answer = answers(known.conditions.effects)[int(np.argmax(probabilities(known)))]
        right = done and answer == "".join(truth["effects"])
        error = np.zeros(4)
    return Row(
        preset,
        policy,
        seed,
        info["runs"],
        info["rig_time_s"],
        done,
        done and info["runs"] == 1,
        right,
        round(float(error[PARAMETERS.index("cn_beta")]), 4),
        round(float(error[PARAMETERS.index("cn_r")]), 4),
    )


def play_all(preset: str, policy: str, use: Policy | None = None) -> list[Row]:
    """Play all seeds of a preset, each in a process; arguments as in `play`."""
    episodes = Experiment(
        "episodes",
        range(SEEDS[preset]),
        partial(_played, preset, policy, use),
        str,
        {"preset": preset, "policy": policy},
    )
    with bar(f"{preset} {policy}") as progress:
        results, _ = results_of(episodes, None, crew(None, None, SEEDS[preset]), progress)
    return [Row(**row) for row in results.iter_rows(named=True)]


def _played(preset: str, policy: str, use: Policy | None, seed: int) -> Done:
    return Done({RESULTS: parquet(pl.DataFrame([asdict(play(preset, policy, seed, use))]))})


def to_csv(rows: Sequence[Row]) -> str:
    """Rows as CSV with a header."""
    stream = io.StringIO()
    writer = csv.DictWriter(stream, [field.name for field in fields(Row)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(row) for row in rows)
    return stream.getvalue()


def from_csv(text: str) -> list[Row]:
    """The inverse of `to_csv`."""
    kinds: dict[str, Any] = {"seed": int, "runs": int, "rig_time_s": float}
    kinds |= {"cn_beta_error": float, "cn_r_error": float}
    flags = ("reached", "on_first", "right")
    rows = []
    for line in csv.DictReader(io.StringIO(text)):
        values: dict[str, Any] = {name: kinds.get(name, str)(value) for name, value in line.items()}
        rows.append(Row(**{**values, **{name: line[name] == "True" for name in flags}}))
    return rows


def median_interval(values: Array) -> tuple[float, float, float]:
    """The median with a distribution-free interval of at least 95 %.

    Args:
        values: values, shape (n,).
    """
    ordered = np.sort(values)
    # Of n values, those of ranks k+1 and n−k enclose the median unless at most k lie on one side of it.
    k = int(binom.ppf(0.5 * (1.0 - _CONFIDENCE), ordered.size, 0.5))
    if binom.cdf(k, ordered.size, 0.5) > 0.5 * (1.0 - _CONFIDENCE):
        k -= 1
    k = max(k, -1) + 1
    low, high = (ordered[k - 1], ordered[-k]) if k > 0 else (ordered[0], ordered[-1])
    return float(np.median(ordered)), float(low), float(high)


def table(rows: Sequence[Row], preset: str, policies: Sequence[str] | None = None) -> str:
    """The comparison as a table in Markdown.

    Args:
        policies: policies; the others are compared with the first, seed by seed; None: those of `CONTESTS`.
    """
    first, *others = CONTESTS[preset] if policies is None else policies
    lines = [
        "| policy | runs, median (95 %) | rig time, median (95 %) [min] | goal reached | with run one | right |",
        "|---|---|---|---|---|---|",
    ]
    for policy in (first, *others):
        own = _of(rows, preset, policy)
        lines.append(
            f"| {policy} | {_shown(_values(own, 'runs'), 1.0, 0)} | "
            f"{_shown(_values(own, 'rig_time_s'), 60.0, 1)} | "
            f"{_share(own, 'reached')} | {_share(own, 'on_first')} | {_share(own, 'right')} |"
        )
    for other in others:
        a, b = _of(rows, preset, first), _of(rows, preset, other)
        runs = _values(b, "runs") - _values(a, "runs")
        spent = _values(b, "rig_time_s") - _values(a, "rig_time_s")
        lines.append(
            f"| {other} less {first}, seed by seed | {_shown(runs, 1.0, 0)} | {_shown(spent, 60.0, 1)} | | | |"
        )
    return "\n".join(lines)


def _of(rows: Sequence[Row], preset: str, policy: str) -> list[Row]:
    found = [row for row in rows if row.preset == preset and row.policy == policy]
    return sorted(found, key=lambda row: row.seed)


def _values(rows: Sequence[Row], name: str) -> Array:
    return np.array([float(getattr(row, name)) for row in rows])


def _shown(values: Array, unit: float, digits: int) -> str:
    middle, low, high = (value / unit for value in median_interval(values))
    halves = digits if digits or middle == round(middle) else 1
    return f"{middle:.{halves}f} ({low:.{digits}f} to {high:.{digits}f})"


def _share(rows: Sequence[Row], name: str) -> str:
    hits = int(np.sum(_values(rows, name)))
    low, high = Proportion(hits, len(rows)).interval
    return f"{hits} of {len(rows)} ({100 * low:.0f} to {100 * high:.0f} %)"


def fill(page: str, rows: Sequence[Row]) -> str:
    """A page with its tables replaced."""
    for preset in CONTESTS:
        page = replaced(page, preset, table(rows, preset))
    return page


def example(seed: int = 0) -> dict[str, tuple[Array, Array]]:
    """Standard deviation of Cnr against the rig time in one campaign, by policy.

    Returns:
        By policy: rig time [s] and relative standard deviation (1), each of shape (runs + 1,).
    """
    found = {}
    for policy in CONTESTS["identification"]:
        env = CampaignEnv(**ARGUMENTS["identification"])
        run_campaign(env, POLICIES[policy], seed=seed)
        spread = np.array([belief.relative_std("cn_r") for belief in env.known.beliefs])
        found[policy] = (np.concatenate(([0.0], np.cumsum(env.known.costs))), spread)
    return found


@styled
def policies_figure(rows: Sequence[Row], followed: Mapping[str, tuple[Array, Array]]) -> Figure:
    """One campaign of each policy, and the share of all campaigns that have reached the goal, against the rig time.

    Args:
        followed: campaigns from `example`.
    """
    fig = figure(WIDTH, 2.9)
    panels = fig.subplots(1, 3)
    for place, (policy, (spent, spread)) in enumerate(followed.items()):
        style: dict[str, Any] = {"color": COLOURS[_COLOUR[policy]], "marker": MARKERS[place], "label": policy}
        panels[0].plot(spent / 60.0, 100.0 * spread, ms=3.5, **style)
    panels[0].axhline(100.0 * _GOAL, color="0.4", linestyle="--", linewidth=0.8, label="goal")
    log_axis(panels[0], "y")
    panels[0].set_ylabel("standard deviation of Cnr [%]")
    panels[0].set_title("identification, seed 0")
    for axes, (preset, policies) in zip(panels[1:], CONTESTS.items(), strict=True):
        longest = max(row.rig_time_s for row in rows if row.preset == preset) / 60.0
        for place, policy in enumerate(policies):
            own = _of(rows, preset, policy)
            spent = np.sort([row.rig_time_s / 60.0 for row in own if row.reached])
            share = 100.0 * np.arange(1, spent.size + 1) / len(own)
            # the last share extends to the end: the other campaigns did not reach the goal
            x, y = np.concatenate(([0.0], spent, [longest])), np.concatenate(([0.0], share, share[-1:]))
            dash = ("-", "--", "-.")[place]
            axes.step(x, y, dash, where="post", color=COLOURS[_COLOUR[policy]], label=policy)
        axes.set_ylim(0.0, 102.0)
        axes.set_ylabel("campaigns at the goal [%]")
        axes.set_title(f"{preset}, {len(own)} seeds")
    for axes in panels:
        axes.set_xlabel("rig time [min]")
        axes.set_xlim(0.0, None)
        grid(axes)
    known: dict[str, Any] = {}
    for axes in panels[::-1]:  # a policy of the first panel is shown by its line in that panel
        known |= dict(zip(*axes.get_legend_handles_labels()[::-1], strict=True))
    fig.legend(known.values(), known.keys(), loc="outside upper center", ncols=4)
    return fig


def main(arguments: Sequence[str] | None = None) -> int:
    """Play the episodes and write the page's numbers, tables and figure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("docs", type=Path, help="the folder docs of the source tree")
    parser.add_argument(
        "--preset", choices=list(CONTESTS), help="play this one anew and keep the other's rows"
    )
    given = parser.parse_args(arguments)
    docs: Path = given.docs
    table_of_episodes = docs / "campaign-design.csv"
    rows: list[Row] = []
    if given.preset is not None and table_of_episodes.exists():
        kept = from_csv(table_of_episodes.read_text(encoding="utf-8"))
        rows = [row for row in kept if row.preset != given.preset]
    for preset in CONTESTS if given.preset is None else (given.preset,):
        for policy in CONTESTS[preset]:
            rows += play_all(preset, policy)
    rows.sort(key=lambda row: (list(CONTESTS).index(row.preset), row.policy, row.seed))
    write_whole(table_of_episodes, to_csv(rows).encode())
    if {row.preset for row in rows} == set(CONTESTS):
        page = docs / "campaign-design.md"
        write_whole(page, fill(page.read_text(encoding="utf-8"), rows).encode())
        save(policies_figure(rows, example()), docs / "images" / "campaign-design.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
