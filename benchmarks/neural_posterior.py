"""The neural posterior against output error: clean records, and blind sets of campaigns with known truth.

Run as ``python -m benchmarks.neural_posterior``; see README.md beside it. ``clean`` needs nothing else; ``blind``
reads folders written by ``tunnel blind`` with their keys. Both write a table; ``show`` prints summaries of tables.
"""

from __future__ import annotations

import argparse
import json
import time
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.estimators import bound_of, records
from identification import identify
from identification.estimators.neural_posterior import NeuralPosterior
from identification.neural.posterior import distribution, forward, variances
from identification.neural.rivals import CAMPAIGN_NAMES, RECORD_NAMES
from tunnel_lab.experiments.training import INPUTS, ShardedTraining, fit, losses, start_state, usable
from tunnel_lab.experiments.training_samples import read_samples
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, SensorProperties

NAMES = ("cn_beta", "cn_r")
MODERATE = (1.0, 10.0)  # excess in noise variances
METHODS = ("output_error", "neural_posterior")
BAND = 1.358  # 95 % point of Kolmogorov's statistic times the root of the number
FAR = 3.0  # error in stated standard deviations above which an estimate should be refused
Row = dict[str, Any]


def unrefusing() -> NeuralPosterior:
    """The estimator with its refusals switched off, to see the refused estimates."""
    bold = NeuralPosterior()
    networks = {kind: replace(one, threshold=np.inf) for kind, one in bold.networks.items()}
    vars(bold)["networks"] = networks
    return bold


def clean_rows(count: int, seed: int) -> Iterator[Row]:
    """Damped sinusoids in white noise: errors over the bound, and whether the interval contains the truth."""
    estimator = NeuralPosterior()
    for cell, number, campaign in records(count, seed):
        zeta, frequency, share, _ = cell
        bound = bound_of(cell, campaign)
        run = estimator.estimate(campaign).runs[0]
        row: Row = {"cell": f"{zeta:g}, {frequency:g} Hz, {share:g}", "number": number}
        truths = {"zeta": zeta, "omega_n": 2.0 * np.pi * frequency / np.sqrt(1.0 - zeta**2)}
        for name, truth in truths.items():
            found = getattr(run, name)
            if found is None:
                continue
            low, high = found.interval
            row[name] = {
                "error": (found.value - truth) / getattr(bound, name),
                "std": found.std / getattr(bound, name),
                "held": low <= truth <= high,
            }
        yield row


def blind_rows(folder: Path, kinds: Sequence[str]) -> Iterator[Row]:
    """Cnβ and Cnr of every campaign of a blind set by both methods."""
    neural, bold = NeuralPosterior(), unrefusing()
    truths = json.loads((folder / "key.json").read_text())["truths"]
    for name, truth in truths.items():
        if truth["kind"] not in kinds:
            continue
        campaign = read_campaign(folder / name)
        # The key has more digits of the density than the campaign, and the coefficients scale with it.
        exact = truth["air_density"] / next(run.air_density for run in campaign.runs if run.wind_on)
        truth |= {quantity: truth[quantity] * exact for quantity in NAMES}
        row: Row = {
            "campaign": f"{folder.name}/{name}",
            **{key: truth[key] for key in ("kind", "effects", "form", "severity")},
            "groups": [one["group"] for one in truth["parameters"].values()],
        }
        for label, estimator in (("neural_posterior", neural), ("output_error", "output_error")):
            begun = time.process_time()
            found = identify(campaign, estimator, throw=False)
            row[label] = {"s": time.process_time() - begun, "status": found.status.name}
            if found.status.name == "UNLIKE_TRAINING" or found.cn_beta is None:
                found = identify(campaign, bold if label == "neural_posterior" else estimator, throw=False)
            for quantity in NAMES:
                value = getattr(found, quantity)
                if value is not None:
                    low, high = value.interval or value.value + 1.96 * value.std * np.array((-1.0, 1.0))
                    row[label][quantity] = {
                        "error": value.value - truth[quantity],
                        "std": value.std,
                        "held": bool(low <= truth[quantity] <= high),
                    }
        yield row


def calibration_rows(folder: Path) -> Iterator[Row]:
    """The place of the truth in the posterior of every tuning sample, from 0 to 1: uniform if calibrated."""
    networks = NeuralPosterior().networks
    for kind, names in (("record", RECORD_NAMES), ("campaign", CAMPAIGN_NAMES)):
        samples = usable(read_samples(folder, f"{kind}s", "tuning"))
        output = forward(np, networks[kind].weights, *(samples[name] for name in INPUTS))
        stds = np.sqrt(variances(output, samples["widths"]))
        target = samples["target"][:, None].astype(np.float64)
        places = distribution(np.exp(output.logarithms), output.means, stds, target)[:, 0]
        for place, known, labels in zip(places, samples["known"], samples["labels"], strict=True):
            found = {name: float(one) for name, one, there in zip(names, place, known, strict=True) if there}
            yield {"place": found, "effects": int(labels.sum())}


def curve_rows(folder: Path, steps: int) -> Iterator[Row]:
    """The loss on tuning samples of campaign networks fitted to increasing numbers of shards."""
    shards = len(list(folder.glob("campaigns/training-*")))
    apart = usable(read_samples(folder, "campaigns", "tuning"))
    spec = ShardedTraining(steps=steps)
    counts = sorted({max(1, shards // 4), max(1, shards // 2)})
    for count in counts:
        samples = usable(read_samples(folder, "campaigns", "training", count))
        start = start_state(samples, spec)
        if count == counts[0]:
            yield {"curve": 0, "loss": float(losses(np, start.weights, apart)[0])}
        found = fit(samples, spec, start)
        yield {"curve": len(samples["target"]), "loss": float(losses(np, found.weights, apart)[0])}
    whole = len(usable(read_samples(folder, "campaigns", "training", shards))["target"])
    final = NeuralPosterior().networks["campaign"].weights
    yield {"curve": whole, "loss": float(losses(np, final, apart)[0])}


def batch_milliseconds(count: int = 100) -> float:
    """Processor time per record in a campaign of a hundred records of 20 s at 1 kHz."""
    runs = [campaign.runs[0] for _, _, campaign in records(6, 1)][:count]
    numbered = tuple(replace(run, id=f"r{number}") for number, run in enumerate(runs))
    campaign = Campaign("batch", RigProperties(), SensorProperties(1000.0), numbered)
    estimator = NeuralPosterior()
    estimator.estimate(campaign)
    begun = time.process_time()
    estimator.estimate(campaign)
    return 1e3 * (time.process_time() - begun) / len(numbered)


def show_clean(console: Console, rows: Sequence[Row]) -> None:
    """RMSE over the bound by cell, and coverage over all."""
    if not rows:
        return
    cells: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        cells[row["cell"]].append(row)
    for name in ("zeta", "omega_n"):
        found = {
            cell: float(np.sqrt(np.mean([row[name]["error"] ** 2 for row in own if name in row])))
            for cell, own in cells.items()
        }
        held = [row[name]["held"] for row in rows if name in row]
        widths = [row[name]["std"] for row in rows if name in row]
        console.print(
            f"{name}: RMSE over the bound {np.median(list(found.values())):.2f} in the median cell, "
            f"{max(found.values()):.2f} in the worst ({max(found, key=lambda cell: found[cell])}); "
            f"95 % intervals held {100 * np.mean(held):.1f} ± {share_std(held):.1f} %; "
            f"median stated deviation {np.median(widths):.2f} bounds; failed "
            f"{len(rows) - len(held)} of {len(rows)}"
        )


def share_std(values: Sequence[bool]) -> float:
    """Standard deviation of a share, %."""
    share = float(np.mean(values))
    return 100.0 * float(np.sqrt(share * (1.0 - share) / max(len(values), 1)))


def show_blind(console: Console, rows: Sequence[Row]) -> None:
    """Median errors, coverage and refusals of both methods by kind of campaign."""
    if not rows:
        return
    single = [row for row in rows if row["kind"] == "single"]
    moderate = [row for row in single if MODERATE[0] <= row["severity"] <= MODERATE[1]]
    groups = {
        "no effect": [row for row in rows if row["kind"] == "none"],
        "one effect, 1 to 10": moderate,
        "… textbook or common form": [row for row in moderate if "rare" not in row["groups"]],
        "… rare form": [row for row in moderate if "rare" in row["groups"]],
        "one effect, above 10": [row for row in single if row["severity"] > MODERATE[1]],
        "two to four effects": [row for row in rows if row["kind"] in ("pair", "three", "four")],
        "outside the vocabulary": [row for row in rows if row["kind"] == "outside"],
    }
    heads = (
        "campaigns",
        "number",
        "",
        "output error",
        "neural",
        "ratio",
        "coverage, OE",
        "coverage, neural",
        "refused",
    )
    table = Table(*heads, title="Median absolute error, 1/rad; coverage of the 95 % intervals")
    for title, own in groups.items():
        for name in NAMES:
            both = [r for r in own if name in r["output_error"] and name in r["neural_posterior"]]
            if not both:
                continue
            errors = {m: np.median([abs(r[m][name]["error"]) for r in both]) for m in METHODS}
            held = {m: [r[m][name]["held"] for r in both] for m in METHODS}
            refused = [r["neural_posterior"]["status"] == "UNLIKE_TRAINING" for r in own]
            table.add_row(
                title if name == NAMES[0] else "", str(len(both)), name, f"{errors['output_error']:.2g}",
                f"{errors['neural_posterior']:.2g}",
                f"{errors['neural_posterior'] / errors['output_error']:.2f}",
                *(f"{100 * np.mean(held[m]):.0f} ± {share_std(held[m]):.0f} %" for m in METHODS),
                f"{100 * np.mean(refused):.0f} %",
            )  # fmt: skip
    console.print(table)
    off = [r for r in groups["outside the vocabulary"] if _off(r)]
    if off:
        refused = [r["neural_posterior"]["status"] == "UNLIKE_TRAINING" for r in off]
        console.print(
            f"Outside the vocabulary and off by more than {FAR:g} stated deviations: {len(off)}, of them refused "
            f"{100 * np.mean(refused):.0f} ± {share_std(refused):.0f} %"
        )


def show_calibration(console: Console, rows: Sequence[Row]) -> None:
    """Coverage of central intervals, and the largest distance from a uniform distribution against its 95 % band."""
    for name in (*RECORD_NAMES, *CAMPAIGN_NAMES) if rows else ():
        places = np.sort([row["place"][name] for row in rows if name in row["place"]])
        if not places.size:
            continue
        away = float(np.abs(np.arange(1, places.size + 1) / places.size - places).max())
        held = {level: float(np.mean(np.abs(places - 0.5) < 0.5 * level)) for level in (0.5, 0.8, 0.95)}
        console.print(
            f"{name}: {places.size} samples; "
            + ", ".join(
                f"{100 * level:.0f} % intervals hold {100 * share:.1f} %" for level, share in held.items()
            )
            + f"; largest distance from uniform {away:.3f} (95 % band {BAND / np.sqrt(places.size):.3f})"
        )


def _off(row: Row) -> bool:
    own = [row["neural_posterior"][name] for name in NAMES if name in row["neural_posterior"]]
    return any(abs(one["error"]) > FAR * one["std"] for one in own)


def written(rows: Iterable[Row], path: Path) -> list[Row]:
    """Write rows immediately, replacing an earlier table of the same name."""
    found = []
    with path.open("w") as file:
        for row in rows:
            found.append(row)
            file.write(json.dumps(row, default=bool) + "\n")
            file.flush()
    return found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.neural_posterior", description=__doc__.splitlines()[0]
    )
    parser.add_argument("what", choices=("clean", "blind", "calibration", "curve", "show"))
    parser.add_argument(
        "folders", nargs="*", type=Path, help="blind sets, shards of a training, or tables to show"
    )
    parser.add_argument("--steps", type=int, default=1000, help="of each fit of the curve")
    parser.add_argument("--records", type=int, default=20, help="records in each of the 18 clean cells")
    parser.add_argument("--seed", type=int, default=1, help="of the clean records' noise")
    parser.add_argument("--kinds", default="none,single,outside", help="kinds of campaign of the blind sets")
    parser.add_argument("--out", type=Path, default=Path("neural-posterior.jsonl"), help="table to write")
    options = parser.parse_args()
    console = Console(width=150)
    if options.what == "show":
        rows = [json.loads(line) for path in options.folders for line in path.read_text().splitlines()]
    elif options.what == "clean":
        rows = written(clean_rows(options.records, options.seed), options.out)
        console.print(f"{batch_milliseconds():.1f} ms per record in a batch of 100")
    elif options.what == "calibration":
        rows = written(calibration_rows(options.folders[0]), options.out)
    elif options.what == "curve":
        rows = written(curve_rows(options.folders[0], options.steps), options.out)
    else:
        found = (row for folder in options.folders for row in blind_rows(folder, options.kinds.split(",")))
        rows = written(found, options.out)
    show_clean(console, [row for row in rows if "cell" in row])
    show_blind(console, [row for row in rows if "campaign" in row])
    show_calibration(console, [row for row in rows if "place" in row])
    for row in (row for row in rows if "curve" in row):
        console.print(f"{row['curve']} readings of campaigns in the training: loss {row['loss']:.3f}")


if __name__ == "__main__":
    main()
