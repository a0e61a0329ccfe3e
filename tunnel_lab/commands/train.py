"""``tunnel train``: the networks of an estimator, trained from a seed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from identification.neural.train import TrainingSpec

NAME = "train"
CHECKPOINT_EVERY_S = 5.0


def run(
    out: Annotated[
        Path, typer.Argument(help="File to write (.safetensors), with a record (.json) beside it.")
    ],
    seed: Annotated[
        int, typer.Option("--seed", min=0, help="Seed of the initial weights and the test set.")
    ] = 1,
    zeta: Annotated[
        tuple[float, float], typer.Option("--zeta", help="Range of damping ratios.", metavar="LOW HIGH")
    ] = (0.001, 0.35),
    omega: Annotated[
        tuple[float, float], typer.Option("--omega", help="Range of ωn, rad/s.", metavar="LOW HIGH")
    ] = (0.4, 26.0),
    starts: Annotated[
        int, typer.Option("--starts", min=1, help="Number of training runs of each network.")
    ] = 3,
    steps: Annotated[
        int | None,
        typer.Option(
            "--steps",
            min=1,
            help="Largest number of steps of each network. Default: 400 for ζ, 3000 for ωn; 2000 for "
            "neural_posterior.",
        ),
    ] = None,
    estimator: Annotated[
        Literal["neural_network", "neural_posterior"],
        typer.Option("--estimator", "-e", help="Whose networks to train."),
    ] = "neural_network",
    shards: Annotated[
        int,
        typer.Option("--shards", min=1, help="For neural_posterior: training campaigns, in units of 200."),
    ] = 15,
    jobs: Annotated[
        int, typer.Option("--jobs", min=0, help="For neural_posterior: processes that simulate.")
    ] = 2,
    restart: Annotated[
        bool, typer.Option("--restart", help="Start again instead of continuing an interrupted training.")
    ] = False,
) -> None:
    """Train networks: the paper's, 100-5-5-1 for ζ and 2-2-5-1 for ωn, or the posterior's.

    Full-batch Levenberg-Marquardt with Bayesian regularisation on impulse
    responses over the ranges given. Each network is trained from several random
    starts, and the one with the largest evidence is kept. The effective number of
    parameters γ, α, β and the errors on test responses are shown and written as
    JSON beside the weights. The same seed gives the same bits on the same machine.
    Training takes half a minute on an idle core.

    An interrupted training leaves OUT.part.safetensors; the same command continues
    from there and gives the same bits.

    With --estimator neural_posterior, campaigns are drawn and simulated by the
    reference simulator with effects in many forms, and two networks are fitted to
    them: one for a record, one for a campaign. --zeta, --omega and --starts do not
    apply. Unfinished work is in the folder OUT.part; it does not matter how many
    processes simulate.

    [bold]Examples[/bold]
      tunnel train mine.safetensors --seed 7
      tunnel train wide.safetensors --zeta 0.001 0.5 --omega 0.4 60
      tunnel identify c -e neural_network --weights mine.safetensors
      tunnel train posterior.safetensors -e neural_posterior

    [bold]Exit status[/bold]
      0 trained, 2 bad input, 130 interrupted (finished work is kept).
    """
    from identification.neural.train import TrainingSpec
    from identification.neural.training_set import DataSpec

    if out.suffix != ".safetensors":
        _refuse(f"{out}", "does not end in .safetensors", "give the file this suffix")
    if estimator == "neural_posterior":
        _train_posterior(out, seed, shards, steps or 2000, jobs=jobs, restart=restart)
        return
    _check_range("--zeta", zeta, 0.0, 0.95)
    _check_range("--omega", omega, 0.0, 1e4)
    data = DataSpec(zeta_range=zeta, omega_range=omega)
    spec = TrainingSpec(seed, data, starts, steps or 400, steps or 3000)
    _train(out, spec, restart=restart)


def _train_posterior(out: Path, seed: int, shards: int, steps: int, *, jobs: int, restart: bool) -> None:
    """Train and write both networks of `neural_posterior`, with a record beside them."""
    import shutil

    from tunnel_lab.experiments.training import TrainingSpec, train
    from tunnel_lab.terminal.progress import bar
    from tunnel_lab.terminal.tables import say
    from tunnel_sim.files.writing import refuse_unwritable, write_json, write_whole

    for path in (out, out.with_suffix(".json")):
        refuse_unwritable(path)
    folder = out.with_suffix(".part")
    if restart and folder.exists():
        shutil.rmtree(folder)
    with bar("training", 1) as progress:
        weights, record = train(
            TrainingSpec(seed, shards, steps),
            folder,
            jobs=jobs,
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


def _train(out: Path, spec: TrainingSpec, *, restart: bool) -> None:
    from time import monotonic

    from identification.neural.train import Checkpoint, read_checkpoint, train
    from tunnel_lab.terminal.progress import bar
    from tunnel_lab.terminal.tables import say
    from tunnel_sim.files.writing import refuse_unwritable, write_json, write_whole

    partial = out.with_suffix(".part.safetensors")
    for path in (out, out.with_suffix(".json"), partial):
        refuse_unwritable(path)
    resume = None if restart else read_checkpoint(partial, spec.to_json_dict())
    if partial.exists() and resume is None and not restart:
        _refuse(str(partial), "belongs to another training", "add --restart, or name another file")
    latest, written = resume or Checkpoint(), monotonic()

    def keep(checkpoint: Checkpoint) -> None:
        nonlocal latest, written
        latest = checkpoint
        if monotonic() - written > CHECKPOINT_EVERY_S:
            write_whole(partial, checkpoint.to_bytes(spec.to_json_dict()))
            written = monotonic()

    try:
        with bar("training", spec.total_work) as progress:
            trained = train(
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
    _show(trained.record)
    say(f"Written: {out} and {out.with_suffix('.json')}")


def _show(record: dict[str, Any]) -> None:
    from tunnel_lab.terminal.tables import say, show_tables, table

    headings = ("γ [1]", "α [1]", "β [1]", "ln evidence")
    result = table(f"Trained with seed {record['seed']}", "network", "start", *headings, right=headings)
    for name, network in record["networks"].items():
        for number, start in enumerate(network["starts"], 1):
            result.add_row(
                f"{name} {'-'.join(map(str, network['sizes']))}",
                f"{number}{' kept' if number == network['chosen_start'] else ''}",
                f"{start['effective_parameters']:.1f} of {network['parameters']}",
                f"{start['alpha']:.3f}", f"{start['beta']:.2e}", f"{start['log_evidence']:.1f}",
            )  # fmt: skip
    show_tables(result)
    errors = record["errors"]
    say(
        f"On {record['data']['test_count']} test responses: errors of ζ up to {errors['zeta']:.1e} "
        f"({100 * errors['zeta_relative']:.2g} % of ζ at most), "
        f"ωn to {100 * errors['omega_relative']:.2g} %"
    )


def _check_range(option: str, limits: tuple[float, float], above: float, below: float) -> None:
    if not above < limits[0] < limits[1] < below:
        _refuse(
            option,
            f"{limits[0]:g} {limits[1]:g} is not a range",
            f"give LOW HIGH between {above:g} and {below:g}",
        )


def _refuse(where: str, what: str, remedy: str) -> None:
    from tunnel_sim.vocabulary.errors import TunnelError

    raise TunnelError(what, where=where, remedy=remedy)
