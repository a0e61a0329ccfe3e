"""Diagnose measured driven records, and predict motion that was not fitted.

``python -m docs.studies.driven_records --data FOLDER [--answers FOLDER]`` writes ``docs/driven-records.md`` and its
figure. The folder of data has the campaigns ``silverbox`` and ``emps``. Diagnoses already in the folder of answers,
as JSON, are not repeated.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from diagnosis import diagnose, vocabulary
from diagnosis.diagnosable import choose
from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.likelihood.partial import fit_seen
from diagnosis.model.parameters import Point
from diagnosis.result import Diagnosis
from diagnosis.search.investigate import nominal_study
from identification import identify
from identification.show.style import save
from tunnel_lab.report.diagnosis_file import read_diagnosis
from tunnel_sim.effects.registry import answering_with
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.campaign import Campaign, Run
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array, Record

PAGE = Path(__file__).parents[1] / "driven-records.md"
ARROW = "arrow"
_QUIET = 30  # samples over which an input with a smaller standard deviation than `_SILENCE` counts as quiet
_SILENCE = 1.5e-3  # V
PUBLISHED = {
    "yaw_inertia": (95.1, "kg"),
    "mechanical_damping": (203.5, "N s/m"),
    "friction_moment": (20.4, "N"),
    "moment_offset": (3.2, "N"),
}
"""Values and units of EMPS (Janot, Gautier and Brunot 2019, who give the offset with the other sign)."""


@dataclass(frozen=True, eq=False)
class Predicted:
    """A model fitted to some of the blocks of a campaign, and its predictions of all blocks.

    Args:
        reading: reading by run id, shape (n,), in the unit of the reading.
        error: reading minus prediction by run id, shape (n,), in the unit of the reading.
    """

    reading: Mapping[str, Array]
    error: Mapping[str, Array]


def fitted(campaign: Campaign, answer: Diagnosis) -> tuple[Fit, Fit]:
    """The nominal model, and the model with the effects of a diagnosis' likeliest answer, fitted to all runs.

    Args:
        answer: the diagnosis; the fit of its effects starts from its parameters.
    """
    likeliest = answer.candidates[0]
    parameters = {  # parameters of a single effect have no prefix
        name if "." in name else f"{likeliest.effect}.{name}": given
        for name, given in likeliest.parameters.items()
    }
    kinds = vocabulary(list(dict.fromkeys(name.split(".")[0] for name in parameters)))
    with answering_with(kinds):
        chosen = choose(campaign, kinds)
        study = nominal_study(chosen.campaign, chosen.kinds)
    nominal = study.nominal
    infos = {f"{kind.name}.{info.name}": info for kind in kinds for info in kind.parameters()}
    freed = {name for name in parameters if infos[name].form}
    problem = replace(nominal.problem, effects=chosen.kinds, free_forms=tuple(sorted(freed)))
    values = dict(zip(nominal.problem.names, nominal.point.common.tolist(), strict=True))
    for name, given in parameters.items():
        values[name] = study.similarity.similar(given.value, infos[name].unit)
    start = Point(np.array([values[name] for name in problem.names]), nominal.point.per_run)
    return nominal, fit(problem, start)


def predicted(whole: Fit, seen: Sequence[NDArray[np.bool_]]) -> Predicted:
    """Fit some blocks, and predict all from the input.

    Args:
        seen: mask of the fitted blocks by run, shape (n,). A run without any keeps its initial state in the fit
            to all blocks.
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
        readings: readings by run id, at the samples of the record, rad; None: the recorded readings.
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
    """Natural frequency (rad/s) and damping ratio by run, shape (runs, 2); largest swing, shape (runs,), rad."""
    rows, swings = [], []
    for run, found in zip(campaign.runs, identify(campaign).runs, strict=True):
        assert found.omega_n is not None
        assert found.zeta is not None
        rows.append((found.omega_n.value, found.zeta.value))
        swings.append(float(np.max(np.abs(run.record.yaw_rad - np.median(run.record.yaw_rad)))))
    return np.array(rows), np.array(swings)


def arrow_figure(nominal: Predicted, causes: Predicted, interval: float, reach: float) -> Figure:
    """The arrow and the errors of both predictions, as the greatest value in every tenth of a second.

    Args:
        interval: interval between blocks, s.
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
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.17), ncols=4, fontsize=8, frameon=False)
    return figure


def silverbox(campaign: Campaign, answer: Diagnosis, image: Path) -> str:
    """The part of the page on the Silverbox.

    Args:
        campaign: the arrow and the multisines.
        answer: the diagnosis of the multisines alone.
        image: file of the figure.
    """
    nominal, whole = fitted(campaign, answer)
    runs = whole.problem.data.runs
    seen = [np.full(run.reading.size, run.id != ARROW) for run in runs]
    models = {
        "linear (the nominal model)": predicted(nominal, seen),
        "with the causes": predicted(whole, seen),
    }
    linear, causes = models.values()
    reach = max(float(np.max(np.abs(linear.reading[run.id]))) for run in runs if run.id != ARROW)
    block = next(run for run in runs if run.id == ARROW)
    interval = block.interval / whole.problem.data.similarity.time
    save(arrow_figure(linear, causes, interval, reach), image)
    beyond = int(np.argmax(np.abs(linear.reading[ARROW]) > reach))
    rows = [
        f"| {name} | {1e3 * rms(np.concatenate([p.error[r.id] for r in runs if r.id != ARROW])):.2f} | "
        f"{1e3 * rms(p.error[ARROW]):.2f} | {1e3 * rms(p.error[ARROW][:beyond]):.2f} | "
        f"{1e3 * rms(p.error[ARROW][beyond:]):.2f} |"
        for name, p in models.items()
    ]
    driven = campaign_without(campaign, ARROW)
    free = gaps(driven)
    length = np.median([run.record.yaw_rad.size for run in free.runs])
    (measured, swing), (simulated, _) = (
        decays(free),
        decays(gaps(driven, {run.id: causes.reading[run.id] - causes.error[run.id] for run in driven.runs})),
    )
    apart = (measured - simulated) / simulated
    error = apart.std(axis=0, ddof=1) / np.sqrt(len(apart))
    within = f"up to {beyond * interval:.0f} s, within the multisines' {1e3 * reach:.0f} mV"
    head = (
        f"| model | multisines (fitted) | arrow, {block.reading.size} samples | {within} | the rest, beyond |"
    )
    return f"""## Silverbox
An electronic Duffing oscillator at 68 Hz (Wigren and Schoukens 2013); volts are taken as radians. Ten runs are
multisines. The *arrow* is noise that grows until it exceeds them.

The diagnosis of the ten multisines: {answer.verdict}

{parameters(answer)}

The likeliest set is fitted to the multisines and predicts the arrow from its input. Only the initial state comes
from the arrow itself; it dies out within a quarter of a second. Root mean square errors in mV:

{head}
|---|---|---|---|---|
{chr(10).join(rows)}

The best published physical models have errors of 0.3 to 0.4 mV on the arrow, and more at its tip.

![The arrow, and the residuals of two models](images/{image.name})

Each multisine ends in a free decay of some {length:.0f} samples: the input is quiet there. The ten decays (of
{1e3 * swing.min():.0f} to {1e3 * swing.max():.0f} mV) are identified by `output_error` as separate records, and
so are the predictions of the driven model. The frequencies differ by
{100 * apart[:, 0].mean():+.3f} ± {100 * error[0]:.3f} %, the damping ratios by
{100 * apart[:, 1].mean():+.2f} ± {100 * error[1]:.2f} % (mean of the ten and its standard deviation).
"""


def campaign_without(campaign: Campaign, run_id: str) -> Campaign:
    """The campaign without one run."""
    return replace(campaign, runs=tuple(run for run in campaign.runs if run.id != run_id))


def parameters(answer: Diagnosis) -> str:
    """Parameters of the likeliest answer as a list."""
    lines = []
    for name, given in answer.candidates[0].parameters.items():
        std = "" if given.std is None else f" ± {given.std:.1g}"
        unit = "" if given.unit == "1" else f" {given.unit}"
        lines.append(f"- `{name}`: {given.value:.4g}{std}{unit}")
    return "\n".join(lines)


def emps(campaign: Campaign, answer: Diagnosis) -> str:
    """The part of the page on the positioning axis.

    Args:
        answer: the diagnosis of the whole record.
    """
    found = {**answer.candidates[0].parameters, **answer.coefficients.after}
    rows = []
    for name, (published, unit) in PUBLISHED.items():
        key = next(key for key in found if key.endswith(name))
        given = found[key]
        std = "" if given.std is None else f" ± {given.std:.2g}"
        rows.append(f"| `{key}` | {given.value:.4g}{std} {unit} | {published:g} {unit} |")
    nominal, whole = fitted(campaign, answer)
    (run,) = whole.problem.data.runs
    half = np.arange(run.reading.size) < run.reading.size // 2
    errors = [1e3 * rms(predicted(model, [half]).error[run.id][~half]) for model in (nominal, whole)]
    return f"""## EMPS
A positioning axis: the motor's force drives a free carriage in closed loop (Janot, Gautier and
Brunot 2019). Metres are taken as radians, newtons as N m.

The diagnosis: {answer.verdict}

| | found | published |
|---|---|---|
{chr(10).join(rows)}

Fitted to the first half of the record, the likeliest set predicts the second half from the force alone with a root
mean square error of {errors[1]:.2f} mm, the nominal model with {errors[0]:.2f} mm; the carriage moves by
{1e3 * float(np.ptp(run.reading)):.0f} mm. The carriage has no restoring force, so small errors of the force
accumulate. The diagnosis decides on no
cause that predicts no better than the nominal model.
The validation record used in the literature is not among these data.
"""


def diagnosed(campaign: Campaign, answers: Path | None, name: str) -> Diagnosis:
    """A diagnosis, read if it exists, otherwise made and kept."""
    path = None if answers is None else answers / f"{name}.json"
    if path is not None and path.exists():
        return read_diagnosis(path)
    found = diagnose(campaign)
    if path is not None:
        write_whole(path, json.dumps(found.to_json_dict()).encode())
    return found


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else "")
    parser.add_argument(
        "--data", type=Path, required=True, help="folder with the campaigns silverbox and emps"
    )
    parser.add_argument("--answers", type=Path, help="folder for the diagnoses, which may take half an hour")
    given = parser.parse_args()
    try:
        box, axis = (read_campaign(given.data / name) for name in ("silverbox", "emps"))
    except TunnelError as bad:
        parser.error(str(bad))
    image = PAGE.parent / "images" / "driven-records-arrow.png"
    multisines = diagnosed(campaign_without(box, ARROW), given.answers, "silverbox")
    parts = [
        "# Measured driven records\n\nTwo published records with published models: the causes that the diagnosis "
        "names, and its predictions of motion that no fit has used.\n"
        "`python -m docs.studies.driven_records --data FOLDER` writes this page. Two rules of the diagnosis were "
        "made with knowledge of these records\n([decision 0029](decisions/0029-driven-runs.md)), so the records "
        "test the predictions, but not these rules.\n",
        silverbox(box, multisines, image),
        emps(axis, diagnosed(axis, given.answers, "emps")),
    ]
    write_whole(PAGE, "\n".join(parts).encode())


if __name__ == "__main__":
    main()
