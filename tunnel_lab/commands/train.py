"""``tunnel train``: the networks of the neural estimators, continued where it stopped."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option

from identification.show.blocks import TextTable
from tunnel_lab.terminal.arguments import SchedulerOption, refuse_unwritable_files
from tunnel_lab.terminal.outputs import say, show
from tunnel_lab.terminal.progress import bar
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from identification.neural.train import TrainingSpec
    from tunnel_lab.experiments.runner import Workers

CHECKPOINT_EVERY_S = 5.0


@dataclass(frozen=True)
class PaperTraining:
    """The training of the paper's networks."""

    zeta: Annotated[
        tuple[float, float], Option("--zeta", help="Range of damping ratios.", metavar="LOW HIGH")
    ] = (0.001, 0.35)
    omega: Annotated[
        tuple[float, float], Option("--omega", help="Range of ωn, rad/s.", metavar="LOW HIGH")
    ] = (0.4, 26.0)
    starts: Annotated[int, Option("--starts", min=1, help="Number of training runs of each network.")] = 3

    def spec(self, seed: int, steps: int | None) -> TrainingSpec:
        """The specification; values that are not a range are refused.

        Args:
            steps: maximum number for each network; None: the usual numbers.
        """
        from identification.neural.networks import DataSpec
        from identification.neural.train import TrainingSpec

        for option, (low, high), most in (("--zeta", self.zeta, 0.95), ("--omega", self.omega, 1e4)):
            if not 0.0 < low < high < most:
                remedy = f"give LOW HIGH between 0 and {most:g}"
                raise TunnelError(f"{low:g} {high:g} is not a range", where=option, remedy=remedy)
        data = DataSpec(zeta_range=self.zeta, omega_range=self.omega)
        return TrainingSpec(seed, data, self.starts, steps or 400, steps or 3000)


@dataclass(frozen=True)
class PosteriorTraining:
    """The training of the networks of ``neural_posterior``."""

    shards: Annotated[
        int, Option("--shards", min=1, help="For neural_posterior: training campaigns, in units of 200.")
    ] = 15
    jobs: Annotated[
        int | None,
        Option("--jobs", min=0, help="For neural_posterior: processes that simulate. Default: 2."),
    ] = None
    scheduler: SchedulerOption = None


def train(
    out: Annotated[Path, Argument(help="File to write (.safetensors), with a record (.json) beside it.")],
    *,
    seed: Annotated[int, Option("--seed", min=0, help="Seed of the initial weights and the test set.")] = 1,
    paper: PaperTraining,
    steps: Annotated[
        int | None,
        Option(
            "--steps",
            min=1,
            help="Largest number of steps of each network. Default: 400 for ζ, 3000 for ωn; 2000 for "
            "neural_posterior.",
        ),
    ] = None,
    estimator: Annotated[
        Literal["neural_network", "neural_posterior"],
        Option("--estimator", "-e", help="Whose networks to train."),
    ] = "neural_network",
    posterior: PosteriorTraining,
    restart: Annotated[
        bool, Option("--restart", help="Start again instead of continuing an interrupted training.")
    ] = False,
) -> None:
    """Train networks: the paper's, 100-5-5-1 for ζ and 2-2-5-1 for ωn, or the posterior's.

    Full-batch Levenberg-Marquardt with Bayesian regularisation on impulse
    responses over the ranges given. Each network is trained from several random
    starts, and the one with the largest evidence is kept. The effective number of
    parameters γ, α, β and the errors on test responses are shown and written as
    JSON beside the weights. The same seed gives a bit-identical result on the same machine.
    Training takes half a minute on an idle core.

    After an interruption the same command continues from OUT.part.safetensors, with a
    bit-identical result.

    With --estimator neural_posterior, campaigns are drawn and simulated by the
    reference simulator with effects in many forms, and two networks are fitted to
    them: one for a record, one for a campaign. --zeta, --omega and --starts do not
    apply. Unfinished work is in the folder OUT.part. The number of processes does not
    affect the result.

    [bold]Examples[/bold]
      tunnel train mine.safetensors --seed 7
      tunnel train wide.safetensors --zeta 0.001 0.5 --omega 0.4 60
      tunnel identify c -e neural_network --weights mine.safetensors
      tunnel train posterior.safetensors -e neural_posterior

    [bold]Exit status[/bold]
      0 trained, 2 bad input, 130 interrupted (finished work is kept).
    """
    from identification.neural.train import Checkpoint, read_checkpoint
    from identification.neural.train import train as train_networks
    from tunnel_sim.files.writing import write_json, write_whole

    if out.suffix != ".safetensors":
        raise TunnelError("does not end in .safetensors", where=str(out), remedy="give the file this suffix")
    if estimator == "neural_posterior":
        from tunnel_lab.experiments.runner import crew

        workers = crew(posterior.jobs, posterior.scheduler, usual=2)
        _train_posterior(out, seed, posterior.shards, steps or 2000, workers, restart)
        return
    spec = paper.spec(seed, steps)
    partial = out.with_suffix(".part.safetensors")
    refuse_unwritable_files(out, out.with_suffix(".json"), partial)
    resume = None if restart else read_checkpoint(partial, spec.to_json_dict())
    if partial.exists() and resume is None and not restart:
        raise TunnelError(
            "belongs to another training", where=str(partial), remedy="add --restart, or name another file"
        )
    latest, written = resume or Checkpoint(), monotonic()

    def keep(checkpoint: Checkpoint) -> None:
        nonlocal latest, written
        latest = checkpoint
        if monotonic() - written > CHECKPOINT_EVERY_S:
            write_whole(partial, checkpoint.to_bytes(spec.to_json_dict()))
            written = monotonic()

    try:
        with bar("training", spec.total_work) as progress:
            trained = train_networks(
                spec,
                resume=resume,
                keep=keep,
                progress=lambda done, text: progress(done, spec.total_work, text),
            )
    except KeyboardInterrupt:
        write_whole(partial, latest.to_bytes(spec.to_json_dict()))
        say(f"Kept: {partial}; the same command continues from there", stderr=True)
        raise
    write_whole(out, trained.weights)
    write_json(out.with_suffix(".json"), trained.record)
    partial.unlink(missing_ok=True)
    record = trained.record
    headings = ("γ [1]", "α [1]", "β [1]", "ln evidence")
    rows = tuple(
        (
            f"{name} {'-'.join(map(str, network['sizes']))}",
            f"{number}{' kept' if number == network['chosen_start'] else ''}",
            f"{start['effective_parameters']:.1f} of {network['parameters']}",
            f"{start['alpha']:.3f}", f"{start['beta']:.2e}", f"{start['log_evidence']:.1f}",
        )
        for name, network in record["networks"].items()
        for number, start in enumerate(network["starts"], 1)
    )  # fmt: skip
    show([TextTable(f"Trained with seed {record['seed']}", ("network", "start", *headings), rows, headings)])
    errors = record["errors"]
    say(
        f"On {record['data']['test_count']} test responses: errors of ζ up to {errors['zeta']:.1e} "
        f"({100 * errors['zeta_relative']:.2g} % of ζ at most), "
        f"ωn to {100 * errors['omega_relative']:.2g} %"
    )
    say(f"Written: {out} and {out.with_suffix('.json')}")


def _train_posterior(out: Path, seed: int, shards: int, steps: int, workers: Workers, restart: bool) -> None:
    """Train and write both networks of `neural_posterior`, with a record beside them."""
    from tunnel_lab.experiments.training import ShardedTraining, train
    from tunnel_sim.files.writing import write_json, write_whole

    refuse_unwritable_files(out, out.with_suffix(".json"))
    folder = out.with_suffix(".part")
    if restart and folder.exists():
        shutil.rmtree(folder)
    with bar("training", 1) as progress:
        weights, record = train(
            ShardedTraining(seed, shards, steps),
            folder,
            workers,
            progress=lambda what, done, all_of_it: progress(done, all_of_it, what),
        )
    write_whole(out, weights)
    write_json(out.with_suffix(".json"), record)
    shutil.rmtree(folder)
    for kind, network in record["networks"].items():
        losses = ", ".join(f"{part} {loss:.3f}" for part, (loss, _) in network["loss"].items())
        say(
            f"{kind}: {network['samples']['training']} samples; −ln of the density at the truth, in standard "
            f"deviations of the nominal fit: {losses}"
        )
    say(f"Written: {out} and {out.with_suffix('.json')}")
