"""What ``tunnel train --estimator neural_posterior`` does: progress, files, and a summary."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from tunnel_lab.terminal.progress import bar
from tunnel_lab.terminal.tables import say
from tunnel_lab.training.train import TrainingSpec, train
from tunnel_sim.files.writing import refuse_unwritable, write_json, write_whole


def train_posterior(out: Path, seed: int, shards: int, steps: int, *, jobs: int, restart: bool) -> None:
    """Train and write both networks of `neural_posterior`.

    Args:
        out: the safetensors file; the record is written beside it.
        shards: of training samples, two hundred campaigns each.
        steps: number of batches of each network.

    Raises:
        TunnelError: when a file cannot be written, or unfinished work belongs to another seed.
    """
    for path in (out, out.with_suffix(".json")):
        refuse_unwritable(path)
    folder = out.with_suffix(".part")
    if restart and folder.exists():
        shutil.rmtree(folder)
    with bar("training", 1) as progress:
        trained = train(
            TrainingSpec(seed, shards, steps),
            folder,
            jobs=jobs,
            progress=lambda what, done, all_of_it: progress(done, all_of_it, what),
        )
    write_whole(out, trained.weights)
    write_json(out.with_suffix(".json"), trained.record)
    shutil.rmtree(folder)
    _show(trained.record)
    say(f"Written: {out} and {out.with_suffix('.json')}")


def _show(record: dict[str, Any]) -> None:
    for kind, network in record["networks"].items():
        losses = ", ".join(f"{part} {loss:.3f}" for part, (loss, _) in network["loss"].items())
        say(
            f"{kind}: {network['samples']['training']} samples; −ln of the density at the truth, in standard "
            f"deviations of the nominal fit: {losses}"
        )
