"""Neural posterior estimation by sbi on the simulations of our own training: clean records, errors over the bound.

sbi is not a dependency. Run ``python -m benchmarks.sbi_posterior`` in a separate environment, made by
``python -m venv beside && beside/bin/pip install . sbi``; see README.md beside it. ``record`` gives sbi forty
periods of the reading, sixteen block means in each, and its convolutional embedding. ``windows`` gives it envelope
and phase of our windows and no embedding. The first call simulates the records.
"""

from __future__ import annotations

import argparse
import importlib.util
import io
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from benchmarks.estimators import bound_of, records
from benchmarks.neural_posterior import Row, show_clean
from identification.neural.demodulated import WINDOWS, Demodulated, demodulate
from identification.neural.rivals import record_features
from identification.signal.frequency import starting_frequency
from tunnel_lab.experiments.training import FAR
from tunnel_lab.experiments.training_samples import (
    ShardSpec,
    decay_of,
    readings_of,
    sizes_at_unit_excess,
    truth_of,
)
from tunnel_reference.catalogue import LINEAR_IN_A_RECORD
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.record import Array, Record

NAMES = ("zeta", "omega_n")
PERIODS, BLOCKS = 40, 16
UNIT = 1e-3  # unit of ζ and of the relative frequency, for a whole record
DRAWS = 1000  # number of samples of each posterior
BATCH = 100


class RecordFeatures(NamedTuple):
    """Features of a record, and the reference values and units of the targets: ζ and ωn in rad/s."""

    features: Array
    values: Array
    units: Array

    def target(self, truth: Array) -> Array:
        return np.arcsinh((truth - self.values) / self.units)

    def natural(self, samples: Array) -> Array:
        return self.values + self.units * np.sinh(np.clip(samples, -30.0, 30.0))


def as_record(record: Record) -> RecordFeatures | None:
    """The reading in periods of its spectral peak, over its largest value; zeros after its end."""
    frequency = starting_frequency(record)
    if frequency is None:
        return None
    place = ((record.time_s - record.time_s[0]) * frequency * BLOCKS).astype(np.int64)
    place = place[place < PERIODS * BLOCKS]
    yaw = record.yaw_rad[: place.size] - record.yaw_rad.mean()
    counts = np.bincount(place, minlength=PERIODS * BLOCKS)
    means = np.bincount(place, yaw, PERIODS * BLOCKS) / np.maximum(counts, 1)
    omega = 2.0 * np.pi * frequency
    return RecordFeatures(means / np.abs(means).max(), np.array([0.0, omega]), UNIT * np.array([1.0, omega]))


def as_windows(record: Record) -> RecordFeatures | None:
    """Envelope and phase of each window in standard deviations, its information, and the record's length.

    The targets are relative to the nominal fit, in its standard deviations, as for our network.
    """
    run = demodulate(record)
    found = record_features([run])[0] if isinstance(run, Demodulated) else None
    if found is None or not isinstance(run, Demodulated):
        return None
    root = np.sqrt(run.information)
    table = np.zeros((3, WINDOWS))
    table[:, : root.size] = np.arcsinh(root * run.logarithm), np.arcsinh(root * run.phase), np.log(root)
    length = (np.log(run.omega * run.time[-1]), run.rate * run.time[-1])
    return RecordFeatures(np.concatenate((table.ravel(), length)), found[0].values, found[0].stds)


VARIANTS = {"record": as_record, "windows": as_windows}


def simulated(seed: int, shards: int) -> Iterator[dict[str, Array]]:
    """Features and targets of both variants for two records of every reading, selected as for our training."""
    sizes = tuple(sorted(sizes_at_unit_excess(seed).items()))
    for shard in range(shards):
        for campaign, conditions, families, number in readings_of(ShardSpec(seed, "training", shard, sizes)):
            if LINEAR_IN_A_RECORD & set(families):
                continue
            count = len(campaign.runs)
            for place in {(5 * number) % count, (5 * number + 2) % count}:
                run = campaign.runs[place]
                seen = {name: found for name, reduce in VARIANTS.items() if (found := reduce(run.record))}
                truth = decay_of(np.array(list(truth_of(conditions).values())), run, campaign.rig)
                if len(seen) == len(VARIANTS) and np.abs(np.sinh(seen["windows"].target(truth))).max() < FAR:
                    features = {f"{name}.x": one.features for name, one in seen.items()}
                    yield features | {f"{name}.theta": one.target(truth) for name, one in seen.items()}


def trained(variant: str, x: Array, theta: Array, minutes: float, seed: int) -> tuple[Any, str]:
    """sbi's posterior with a neural spline flow at its defaults, trained until convergence or the time limit."""
    import torch
    from sbi.inference import NPE
    from sbi.neural_nets import posterior_nn
    from sbi.neural_nets.embedding_nets import CNNEmbedding
    from sbi.utils import BoxUniform
    from sbi.utils.tracking import TensorBoardTracker
    from torch.utils.tensorboard.writer import SummaryWriter

    torch.manual_seed(seed)
    torch.set_num_threads(1)
    given: dict[str, Any] = {}
    if variant == "record":
        given = {"z_score_x": "structured", "embedding_net": CNNEmbedding((PERIODS * BLOCKS,))}
    data = [torch.from_numpy(values.astype(np.float32)) for values in (theta, x)]
    prior = BoxUniform(data[0].amin(0), data[0].amax(0))
    with tempfile.TemporaryDirectory() as folder:
        tracker = TensorBoardTracker(SummaryWriter(folder))  # otherwise it writes into the working directory
        inference = NPE(prior, posterior_nn("nsf", **given), tracker=tracker, show_progress_bars=False)
        inference.append_simulations(*data)
        begun = time.process_time()
        inference.train(max_num_epochs=1)  # two epochs, for timing
        each = (time.process_time() - begun) / 2.0
        inference.train(max_num_epochs=int(60.0 * minutes / each), resume_training=True)
    said = f"{inference.epoch} epochs in {(time.process_time() - begun) / 60.0:.1f} min of processor time"
    return inference.build_posterior(), said


def judged(posterior: Any, variant: str, box: Array, cells: Sequence[Any]) -> Iterator[Row]:
    """Errors over the bound, as in `neural_posterior.clean_rows`; a record without a sample in the prior fails."""
    import torch

    begun = time.process_time()
    seen = [VARIANTS[variant](campaign.runs[0].record) for _, _, campaign in cells]
    there = [one.features for one in seen if one is not None]
    x = torch.from_numpy(np.array(there, dtype=np.float32))
    drawn = posterior.sample_batched((DRAWS,), x=x, reject_outside_prior=False, show_progress_bars=False)
    seconds = (time.process_time() - begun) / len(cells)
    samples = iter(np.moveaxis(drawn.detach().numpy(), 1, 0).astype(np.float64))
    for (cell, number, campaign), one in zip(cells, seen, strict=True):
        zeta, frequency, share, _ = cell
        row: Row = {"cell": f"{zeta:g}, {frequency:g} Hz, {share:g}", "number": number, "s": seconds}
        own = next(samples) if one is not None else np.zeros((0, 2))
        own = own[np.all((own >= box[0]) & (own <= box[1]), axis=1)]
        row["outside"] = 1.0 - len(own) / DRAWS
        if one is not None and len(own):
            bound = bound_of(cell, campaign)
            truths = (zeta, 2.0 * np.pi * frequency / np.sqrt(1.0 - zeta**2))
            for name, truth, values in zip(NAMES, truths, one.natural(own).T, strict=True):
                low, middle, high = np.quantile(values, (0.025, 0.5, 0.975))
                error, std = np.array((middle - truth, (high - low) / 3.92)) / getattr(bound, name)
                row[name] = {"error": error, "std": std, "held": bool(low <= truth <= high)}
        yield row


def main() -> None:
    """Simulate missing samples, train, measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.sbi_posterior", description=__doc__.splitlines()[0]
    )
    parser.add_argument("variant", choices=tuple(VARIANTS))
    parser.add_argument("--samples", type=Path, default=Path("sbi-samples.npz"), help="written where absent")
    parser.add_argument("--shards", type=int, default=15, help="of 200 campaigns each, as in our training")
    parser.add_argument("--minutes", type=float, default=15.0, help="of processor time for the training")
    parser.add_argument("--records", type=int, default=30, help="records in each of the 18 clean cells")
    parser.add_argument("--seed", type=int, default=1, help="of simulations, training and clean records")
    options = parser.parse_args()
    if importlib.util.find_spec("sbi") is None:
        parser.error("sbi is not installed; pip install sbi, in an environment of its own")
    console = Console(width=150)
    if not options.samples.exists():
        begun = time.process_time()
        rows = list(simulated(options.seed, options.shards))
        file = io.BytesIO()
        np.savez(file, **{name: np.stack([row[name] for row in rows]) for name in rows[0]})
        write_whole(options.samples, file.getvalue())
        console.print(f"simulated in {(time.process_time() - begun) / 60.0:.1f} min of processor time")
    samples = np.load(options.samples)
    x, theta = samples[f"{options.variant}.x"], samples[f"{options.variant}.theta"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of sbi
        posterior, said = trained(options.variant, x, theta, options.minutes, options.seed)
        cells, box = list(records(options.records, options.seed)), np.array((theta.min(0), theta.max(0)))
        parts = (cells[first : first + BATCH] for first in range(0, len(cells), BATCH))
        rows = [row for part in parts for row in judged(posterior, options.variant, box, part)]
    show_clean(console, rows)
    console.print(
        f"{len(x)} records; {said}; {100 * np.mean([row['outside'] for row in rows]):.1f} % of the samples outside "
        f"the prior; {1e3 * np.median([row['s'] for row in rows]):.1f} ms per record in batches of {BATCH}"
    )


if __name__ == "__main__":
    main()
