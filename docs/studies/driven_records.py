"""Diagnose measured driven records, and predict motion that no fit has seen.

``python -m docs.studies.driven_records --data FOLDER [--answers FOLDER]`` writes ``docs/driven-records.md`` and the
figure beside it. The folder of data holds the campaigns ``silverbox`` and ``emps``. Diagnoses that are in the folder
of answers already, as JSON, are not made again.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from diagnosis import diagnose, vocabulary
from diagnosis.answer.held_out import fit_seen, one_more
from diagnosis.diagnosable import choose
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.starting_points import starting_points
from diagnosis.search.hypothesis import Hypothesis, polish
from diagnosis.search.investigate import nominal_study
from identification import identify
from tunnel_lab.plotting.style import save
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.record import Array, Record

PAGE = Path(__file__).parents[1] / "driven-records.md"
ARROW = "arrow"
_QUIET = 30  # samples over which an input counts as quiet, where its standard deviation is below
_SILENCE = 1.5e-3  # V
PUBLISHED = {"yaw_inertia": 95.1, "mechanical_damping": 203.5, "friction_moment": 20.4, "moment_offset": -3.2}
"""Of EMPS, in kg, N s/m, N and N (Janot, Gautier and Brunot 2019)."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """A model fitted to some of the blocks of a campaign, and all blocks predicted.

    Args:
        reading: by run id, shape (n,), in the unit of the reading.
        error: reading less prediction by run id, shape (n,), in that unit.
    """

    reading: Mapping[str, Array]
    error: Mapping[str, Array]


def fitted(campaign: Campaign, names: Sequence[str]) -> tuple[Fit, Fit]:
    """The nominal model, and that with some effects, fitted to all runs.

    Args:
        names: of the effects; the one by which linear theory predicts the greatest drop of χ² comes first.
    """
    kinds = vocabulary(names)
    with answering_with(kinds):
        chosen = choose(campaign, kinds)
        nominal = nominal_study(chosen.campaign, chosen.kinds).nominal
        found: Fit | None = nominal
        left = list(chosen.kinds)
        while left and found is not None:
            drops = [starting_points(found, kind)[0].predicted_drop for kind in left]
            found = one_more(found, left.pop(int(np.argmax(drops))))
        if found is None:
            raise RuntimeError(f"{' + '.join(names)} cannot be fitted to {campaign.name}")
        return nominal, polish(Hypothesis(tuple(kind.name for kind in found.problem.effects), found)).fit


def predicted(whole: Fit, seen: Sequence[NDArray[np.bool_]]) -> Predicted:
    """Fit the blocks that are seen, and predict all from the input.

    Args:
        seen: by run, shape (n,). The initial state of a run without any stays that of the fit to all blocks.
    """
    runs = whole.problem.data.runs
    point, _ = fit_seen(whole, seen)
    values = whole.problem.predict([point])[0]
    return Predicted(
        {run.id: run.reading for run in runs},
        {run.id: run.reading - value for run, value in zip(runs, values, strict=True)},
    )


def rms(values: Array) -> float:
    """Root mean square of values of shape (n,), in their unit."""
    return float(np.sqrt(np.mean(values**2)))


def gaps(campaign: Campaign, readings: Mapping[str, Array] | None = None) -> Campaign:
    """The free decays where the input is quiet before the end of each run.

    Args:
        readings: by run id, at the samples of the record, rad; None: those of the records.
    """
    runs: list[Run] = []
    for run in campaign.runs:
        assert run.drive is not None
        windows = np.lib.stride_tricks.sliding_window_view(run.drive.values, _QUIET).std(axis=1)
        half = windows.size // 2
        quiet = np.flatnonzero(windows[half:] < _SILENCE) + half
        inside = slice(int(quiet[0]), int(quiet[-1]) + _QUIET)
        yaw = run.record.yaw_rad if readings is None else readings[run.id]
        time = run.record.time_s[inside]
        runs.append(replace(run, drive=None, record=Record(time - time[0], yaw[inside])))
    return replace(campaign, runs=tuple(runs))


def decays(campaign: Campaign) -> tuple[Array, Array]:
    """Natural frequency (rad/s) and damping ratio of every run, shape (runs, 2), and largest swing, (runs,), rad."""
    rows, swings = [], []
    for run, found in zip(campaign.runs, identify(campaign).runs, strict=True):
        assert found.omega_n is not None and found.zeta is not None
        rows.append((found.omega_n.value, found.zeta.value))
        swings.append(float(np.max(np.abs(run.record.yaw_rad - np.median(run.record.yaw_rad)))))
    return np.array(rows), np.array(swings)


def named(document: Mapping[str, Any]) -> list[str]:
    """The effects of the likeliest answer that has any, in the order in which they close the gap."""
    steps = [step["effect"] for step in document["gap"]["waterfall"] if step["effect"]]
    return steps or [name for c in document["candidates"] for name in c["effect"].split(" + ")][:1]


def arrow_figure(nominal: Predicted, causes: Predicted, interval: float, reach: float) -> Figure:
    """The arrow and the errors of both predictions, as the greatest value in every tenth of a second.

    Args:
        interval: between blocks, s.
        reach: largest reading of the multisines, V.
    """
    figure = Figure(figsize=(8.0, 3.4), layout="constrained")
    axes = figure.subplots()
    length = max(1, round(0.1 / interval))
    for label, values in (
        ("reading", nominal.reading[ARROW]),
        ("error of the nominal model", nominal.error[ARROW]),
        ("error with the causes", causes.error[ARROW]),
    ):
        rows = np.abs(values[: values.size // length * length]).reshape(-1, length).max(axis=1)
        axes.semilogy(0.1 * np.arange(rows.size), 1e3 * rows, label=label, linewidth=1.2)
    axes.axhline(1e3 * reach, color="0.5", linestyle=":", label="largest reading of the multisines")
    axes.set(xlabel="time / s", ylabel="largest in 0.1 s / mV", xlim=(0.0, None))
    axes.legend(loc="upper left", fontsize=8)
    return figure
