"""Campaigns for the neural classifier, and its training: ``python -m benchmarks.causes.neural_training FOLDER``.

The campaigns are drawn as for the benchmark, from the same tracks in the same proportions with another seed.
Effects are scaled as for the benchmark. Motions are integrated in one step per sample, within 0.004 noise standard
deviations of the benchmark's ten steps. FOLDER keeps the campaigns; an interrupted run continues.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.causes.moments import Array
from benchmarks.causes.neural_network import LABELS, LAYERS, WEIGHTS, Classifier, scaled
from benchmarks.causes.tracks import SEED, TRACKS, draw_all
from tunnel_lab.experiments.blind.sets import write_document
from tunnel_sim.vocabulary.errors import TunnelError

TRAINING_SEED = 20290417
TIMES = 8  # campaigns drawn per campaign of the benchmark, in each track; only the first are made
CHUNK = 40
FOLDS, EPOCHS, BATCH, RATE = 5, 120, 32, 2e-3
TEMPERATURES = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4, 1.6, 2.0)
assert TRAINING_SEED != SEED


@dataclass(frozen=True)
class NetworkSetting:
    """A network and its training.

    Args:
        width: width of the hidden layers.
        decay: decay of the weights.
        dropout: share of dropped units.
    """

    width: int
    decay: float
    dropout: float


SETTINGS = tuple(NetworkSetting(w, 1e-2, d) for w in (32, 64) for d in (0.2, 0.4))


def make_campaigns(folder: Path, number: int, *, chunk: int = CHUNK) -> float:
    """Simulate the missing training campaigns.

    Args:
        folder: folder of the campaigns; ``truths`` has the acting causes of each, and the processor time.
        number: number of campaigns.
        chunk: number of campaigns simulated together.

    Returns:
        The total processor time, s.
    """
    from tunnel_reference.make import as_campaign, truth_of
    from tunnel_reference.severity import read_and_fit, simulate_motions, size_separably
    from tunnel_sim.files.campaign_folder import write_campaign

    drawn = draw_all(TRAINING_SEED, {name: TIMES * track.count for name, track in TRACKS.items()})[:number]
    seconds = 0.0
    for first in range(0, len(drawn), chunk):
        done = folder / "truths" / f"{first:05d}.json"
        if not done.exists():
            begun = time.process_time()
            truths: dict[str, Any] = {}
            sized = size_separably([one.draw for one in drawn[first : first + chunk]])
            motions = simulate_motions(sized, fine=False)
            for one, draw, motion in zip(drawn[first : first + chunk], sized, motions, strict=True):
                target = folder / "campaigns" / one.name
                shutil.rmtree(target, ignore_errors=True)
                simulated = read_and_fit(draw, motion)
                try:
                    write_campaign(as_campaign(simulated, one.name), target)
                except TunnelError:  # refused by the reader: left out here, redrawn in the benchmark
                    continue
                truth = truth_of(simulated)
                truths[one.name] = {key: truth[key] for key in ("effects", "small")}
            done.parent.mkdir(parents=True, exist_ok=True)
            write_document(done, {"seconds": time.process_time() - begun, "truths": truths})
            print(f"{first + len(motions)} of {len(drawn)} campaigns", flush=True)
        seconds += float(json.loads(done.read_text(encoding="utf-8"))["seconds"])
    return seconds


@dataclass(frozen=True, eq=False)
class TrainingCampaigns:
    """Training campaigns.

    Args:
        runs: statistics of the runs, shape (campaigns, most runs, k), 0 for missing runs.
        there: whether each run exists, shape (campaigns, most runs).
        whole: statistics of all runs together, shape (campaigns, m).
        acts: whether each label acts, shape (campaigns, labels).
        asked: whether each label is scored (small effects are not), shape (campaigns, labels).
    """

    runs: Array
    there: Array
    whole: Array
    acts: Array
    asked: Array

    def __getitem__(self, places: NDArray[np.int64]) -> TrainingCampaigns:
        """Some of the campaigns."""
        return TrainingCampaigns(*(getattr(self, f.name)[places] for f in fields(self)))


def read_samples(folder: Path) -> TrainingCampaigns:
    """The statistics of all training campaigns of a folder.

    Args:
        folder: from `make_campaigns`.
    """
    from benchmarks.causes.summaries import summaries
    from tunnel_sim.files.campaign_folder import read_campaign

    truths: dict[str, Any] = {}
    for path in sorted((folder / "truths").glob("*.json")):
        truths |= json.loads(path.read_text(encoding="utf-8"))["truths"]
    found = [summaries(read_campaign(folder / "campaigns" / name)) for name in truths]
    most = max(len(runs) for runs, _ in found)
    padded = [np.pad(runs, ((0, most - len(runs)), (0, 0))) for runs, _ in found]
    there = [np.arange(most) < len(runs) for runs, _ in found]
    acts = [[name in truth["effects"] for name in LABELS] for truth in truths.values()]
    asked = [[name not in truth["small"] for name in LABELS] for truth in truths.values()]
    return TrainingCampaigns(
        np.array(padded),
        np.array(there, np.float64),
        np.array([whole for _, whole in found]),
        np.array(acts, np.float64),
        np.array(asked, np.float64),
    )


def trained(
    samples: TrainingCampaigns, seed: int, settings: Sequence[NetworkSetting], epochs: int = EPOCHS
) -> Classifier:
    """Train one network per fold with every setting, and keep the setting with the least held-out loss.

    A network stops at the least loss on its held-out fold. The temperature is optimal on the held-out folds.

    Args:
        seed: seed of folds, first weights and order.

    Returns:
        The classifier, without the facts of the simulation.
    """
    rng = np.random.default_rng(seed)
    begun = time.process_time()
    seen = samples.runs[samples.there > 0.0]
    scaling = [np.stack([v.mean(axis=0), v.std(axis=0) + 1e-3]) for v in (seen, samples.whole)]
    folds = np.array_split(rng.permutation(len(samples.whole)), FOLDS)
    best: tuple[float, NetworkSetting, list[dict[str, Array]], Array] | None = None
    for setting in settings:
        found = []
        for fold in folds:
            rest = np.setdiff1d(np.arange(len(samples.whole)), fold)
            found.append(_train_one(samples[rest], samples[fold], scaling, setting, epochs, rng))
        loss = float(np.mean([one[0] for one in found]))
        print(f"{setting}: {loss:.3f} nats held out", flush=True)
        if best is None or loss < best[0]:
            best = (loss, setting, [one[1] for one in found], np.concatenate([one[2] for one in found]))
    assert best is not None
    held_out = samples[np.concatenate(folds)]
    losses = {t: _loss(best[3] / t, held_out) for t in TEMPERATURES}
    temperature = min(losses, key=losses.__getitem__)
    facts = {
        "campaigns": float(len(samples.whole)),
        "training_s": time.process_time() - begun,
        "held_out": losses[temperature],
        "width": float(best[1].width),
        "decay": best[1].decay,
        "dropout": best[1].dropout,
    }
    return Classifier(best[2], (scaling[0], scaling[1]), temperature, facts)


def _train_one(
    seen: TrainingCampaigns,
    held_out: TrainingCampaigns,
    scaling: Sequence[Array],
    setting: NetworkSetting,
    epochs: int,
    rng: np.random.Generator,
) -> tuple[float, dict[str, Array], Array]:
    """Least held-out loss, its weights, and the held-out logits."""
    import torch

    torch.manual_seed(int(rng.integers(2**31)))
    torch.set_num_threads(1)
    k, m, width = seen.runs.shape[2], seen.whole.shape[1], setting.width
    sizes = ((k, width), (width, width), (2 * width + m, width), (width, len(LABELS)))
    weights = {}
    for name, (inputs, outputs) in zip(LAYERS, sizes, strict=True):
        table = rng.standard_normal((inputs + 1, outputs)) * np.sqrt(2.0 / inputs)
        table[-1] = -2.0 if name == LAYERS[-1] else 0.0
        weights[name] = torch.tensor(table, dtype=torch.float32, requires_grad=True)

    def tensors(given: TrainingCampaigns) -> list[torch.Tensor]:
        x = scaled(given.runs, *scaling[0]) * given.there[:, :, None]
        values = (x, given.there, scaled(given.whole, *scaling[1]), given.acts, given.asked)
        return [torch.tensor(v, dtype=torch.float32) for v in values]

    def logits(x: torch.Tensor, there: torch.Tensor, whole: torch.Tensor, dropout: float) -> torch.Tensor:
        def layer(values: torch.Tensor, name: str) -> torch.Tensor:
            return values @ weights[name][:-1] + weights[name][-1]

        hidden = torch.relu(layer(torch.relu(layer(x, "run 1")), "run 2"))
        mean = (hidden * there[:, :, None]).sum(dim=1) / there.sum(dim=1, keepdim=True)
        most = (hidden * there[:, :, None]).amax(dim=1)  # hidden values are not negative
        pooled = torch.nn.functional.dropout(torch.cat([mean, most, whole], dim=1), dropout, dropout > 0.0)
        hidden = torch.relu(layer(pooled, "all 1"))
        return layer(torch.nn.functional.dropout(hidden, dropout, dropout > 0.0), "all 2")

    both = [tensors(seen), tensors(replace(seen, runs=_mirrored(seen.runs)))]
    test = tensors(held_out)
    optimizer = torch.optim.AdamW(list(weights.values()), lr=RATE, weight_decay=setting.decay)
    bce = torch.nn.functional.binary_cross_entropy_with_logits
    least, kept, out = np.inf, {}, np.zeros(0)
    for _ in range(epochs):
        order = rng.permutation(len(seen.whole))
        for part in np.array_split(order, max(1, order.size // BATCH)):
            x, there, whole, acts, asked = (v[part] for v in both[int(rng.integers(2))])
            loss = bce(logits(x, there, whole, setting.dropout), acts, weight=asked, reduction="sum")
            optimizer.zero_grad()
            (loss / len(part)).backward()
            optimizer.step()
        with torch.no_grad():
            now = logits(*test[:3], 0.0).numpy().astype(np.float64)
        loss_now = _loss(now, held_out)
        if loss_now < least:
            least, out = loss_now, now
            kept = {name: w.detach().numpy().astype(np.float64) for name, w in weights.items()}
    return least, kept, out


def _mirrored(runs: Array) -> Array:
    from benchmarks.causes.summaries import mirrored

    return np.stack([mirrored(one) for one in runs])


def _loss(logits: Array, samples: TrainingCampaigns) -> float:
    """Mean over the campaigns of the cross-entropy of their labels, nats."""
    each = np.logaddexp(0.0, logits) - samples.acts * logits
    return float(np.sum(each * samples.asked) / len(logits))


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command.

    Args:
        arguments: arguments of the command line; None: the process's.

    Returns:
        The exit status.
    """
    parser = argparse.ArgumentParser(prog="python -m benchmarks.causes.neural_training", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the training campaigns are kept")
    parser.add_argument("--campaigns", type=int, default=800, help="number of them, at least 40")
    parser.add_argument("--out", type=Path, default=WEIGHTS, help="weights, a .safetensors file")
    given = parser.parse_args(arguments)
    what = ""
    if given.campaigns < 40:
        what = f"--campaigns: {given.campaigns} are too few to hold some out; give 40 or more"
    elif given.folder.exists() and not given.folder.is_dir():
        what = f"{given.folder}: is not a folder; give one for the training campaigns"
    elif not given.out.absolute().parent.is_dir():
        what = f"{given.out}: its folder does not exist; make it first"
    if what:
        print(what, file=sys.stderr)
        return 2
    simulation = make_campaigns(given.folder, given.campaigns)
    begun = time.process_time()
    samples = read_samples(given.folder)
    statistics = time.process_time() - begun
    found = trained(samples, TRAINING_SEED, SETTINGS)
    facts = {**found.facts, "simulation_s": simulation, "training_s": found.facts["training_s"] + statistics}
    replace(found, facts=facts).save(given.out)
    print(f"{given.out}: {facts}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
