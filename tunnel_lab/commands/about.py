"""``tunnel docs``, ``doctor`` and ``schema``: the documentation, the installation, and the formats of files."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from pkgutil import resolve_name
from typing import Annotated, Any

import typer
from typer import Argument, Option

from identification.show.blocks import TextTable
from tunnel_lab.terminal.arguments import output_file
from tunnel_lab.terminal.encoding import printable_json
from tunnel_lab.terminal.outputs import say, say_written, show
from tunnel_sim.vocabulary.errors import EXTRAS, TunnelError, did_you_mean, installing, library, shown

PACKAGES = ("mujoco", "numpy", "scipy", "torch", "gymnasium", "polars", "matplotlib")
LARGEST_ERROR = 5.0  # largest error in the self-check, standard deviations
_COMPILER_S = 5.0
DIALECT = "https://json-schema.org/draft/2020-12/schema"


def docs(
    source: Annotated[Path, Option(help="Folder of the pages, in the source tree.", file_okay=False)] = Path(
        "docs"
    ),
    out: Annotated[
        Path, Option("--out", "-o", metavar="FOLDER", help="Where the site goes, in its folder html.")
    ] = Path("tunnel-output/docs"),
    browser: Annotated[
        bool, Option("--browser/--no-browser", help="Open the first page, or only print its path.")
    ] = True,
) -> None:
    """Build the documentation site and open it.

    The site has all pages, an API reference and three notebooks, which are
    executed. Only changed pages are built again. Nothing is written into the
    source folder. It needs the extra 'docs'.

    [bold]Examples[/bold]
      tunnel docs
      tunnel docs --out /tmp/site --no-browser

    [bold]Exit status[/bold]
      0 built, 1 a page could not be built, 2 bad input.
    """
    from tunnel_sim.files.writing import output_folder

    if not (source / "conf.py").is_file():
        raise TunnelError(
            "no documentation here", where=shown(source), remedy="run it in the source tree, or give --source"
        )
    build = library("sphinx.cmd.build", "the documentation", "docs").main
    if out.resolve().is_relative_to(source.resolve()):
        raise TunnelError("is among the pages", where=shown(out), remedy="name a folder elsewhere with --out")
    site = output_folder(out) / "html"  # the results of the notebooks are kept beside it
    if build(["-q", "-W", "--keep-going", "-b", "html", str(source), str(site)]):
        raise typer.Exit(1)
    page = (site / "index.html").resolve()
    say(f"Built: {page}")
    if browser:
        typer.launch(page.as_uri())


def doctor() -> None:
    """Show what is installed, and check in a few seconds that it works.

    Versions, compiler, plugin, processors and threads, and the extras that are
    installed. The self-check simulates four runs in MuJoCo with the plugin,
    identifies them, and compares Cnβ and Cnr with the truth.

    [bold]Examples[/bold]
      tunnel doctor
      tunnel doctor --format json

    [bold]Exit status[/bold]
      0 healthy, 1 the self-check failed, 2 bad input.
    """
    checks = tuple(self_check())
    results = tuple((part, text if fine else f"FAILED: {text}") for part, text, fine in checks)
    show(
        [
            TextTable("Installation", ("part", "version or state"), (*installed(), *extras())),
            TextTable("Self-check", ("check", "result"), results),
        ]
    )
    if not all(fine for _, _, fine in checks):
        raise typer.Exit(1)


def installed() -> Iterator[tuple[str, str]]:
    """Versions of the program, Python, the system and the packages; compiler, plugin, processors and threads."""
    from importlib.metadata import PackageNotFoundError, version

    from tunnel_lab.experiments.experiment import ONE_THREAD
    from tunnel_lab.experiments.runner import available_processors
    from tunnel_sim.physics.moment_law import native_library

    def of(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return "not installed"

    yield "tunnel", of("virtual-wind-tunnel")
    yield "Python", f"{platform.python_version()} ({sys.executable})"
    yield "system", f"{platform.system()} {platform.release()}, {platform.machine()}"
    yield from ((name, of(name)) for name in PACKAGES)
    yield "C compiler", compiler()
    try:
        yield "plugin", str(native_library("vwt_plugin"))
    except TunnelError as error:
        yield "plugin", str(error)
    yield "processors", f"{available_processors()} usable of {os.cpu_count()}"
    limits = [f"{name}={os.environ[name]}" for name in ONE_THREAD if name in os.environ]
    yield "thread limits", ", ".join(limits) or "none set"


def compiler() -> str:
    """The C compiler for an installation from source, and its version."""
    name = os.environ.get("CC") or next(filter(shutil.which, ("cc", "gcc", "clang")), None)
    if name is None:
        return "none; needed only to install from source"
    try:
        done = subprocess.run(
            [*name.split(), "--version"], capture_output=True, text=True, timeout=_COMPILER_S, check=False
        ).stdout
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"{name} does not answer ({type(error).__name__})"
    return f"{name}: {(done.splitlines() or ['version unknown'])[0]}"


def extras() -> Iterator[tuple[str, str]]:
    """The extras, and the missing packages of each."""
    from importlib.util import find_spec

    for extra, modules in EXTRAS.items():
        missing = [name for name in modules if find_spec(name) is None]
        lacks = f"lacks {', '.join(missing)}: run {installing(extra)}"
        yield f"extra {extra}", lacks if missing else "installed"


def self_check() -> Iterator[tuple[str, str, bool]]:
    """Simulate and identify a small campaign.

    Yields:
        The check, its result in words, and whether it passed.
    """
    begun = time.perf_counter()
    try:
        from identification import identify
        from tunnel_sim import simulate_campaign
        from tunnel_sim.files.plan_file import paper_plan

        plan = paper_plan()  # four of its runs, cut off after 5 s
        plan = replace(plan, conditions=tuple(replace(run, duration=5.0) for run in plan.conditions[:4]))
        campaign = simulate_campaign(plan)
    except Exception as error:
        yield "simulate", f"{type(error).__name__}: {error}", False
        return
    seconds = time.perf_counter() - begun
    steps = sum(round(1e3 * condition.duration) for condition in plan.conditions)
    yield "simulate", f"{len(campaign.runs)} runs, {steps} steps in {seconds:.1f} s", True
    try:
        estimate = identify(campaign)
    except Exception as error:
        yield "identify", f"{type(error).__name__}: {error}", False
        return
    for name in ("cn_beta", "cn_r"):
        quantity, truth = getattr(estimate, name), getattr(plan.truth, name)
        if quantity is None:
            yield name, estimate.status.value, False
            continue
        away = (quantity.value - truth) / quantity.std
        yield name, f"{away:+.1f} standard deviations from the truth", abs(away) <= LARGEST_ERROR
    yield "time", f"{time.perf_counter() - begun:.1f} s", True


SCHEMAS = {
    "campaign": "tunnel_sim.files.campaign_folder:CampaignDocument.model_json_schema",
    "plan": "tunnel_sim.files.plan_file:PlanDocument.model_json_schema",
    "estimate": "identification.estimate:estimate_schema",
    "diagnosis": "diagnosis.findings.schema:diagnosis_schema",
}
"""By name of the document: the module and the function that makes its schema."""


def schema(
    document: Annotated[str, Argument(help="campaign, plan, estimate or diagnosis.")],
    out: Annotated[
        Path | None, output_file("--out", ".json", help="Write to a file instead of standard output.")
    ] = None,
) -> None:
    """Print the JSON schema of a document.

    An editor with TOML support (such as VS Code with Even Better TOML) completes
    and checks keys of a campaign.toml whose first line names the schema:
    #:schema campaign.schema.json

    [bold]Examples[/bold]
      tunnel schema campaign --out my-campaign/campaign.schema.json
      tunnel schema plan --out plan.schema.json
      tunnel schema diagnosis | jq .properties

    [bold]Exit status[/bold]
      0 printed, 2 bad input.
    """
    from tunnel_sim.files.writing import json_text, write_json

    if document not in SCHEMAS:
        raise TunnelError(
            f"there is no schema {document!r}", where="tunnel schema", remedy=did_you_mean(document, SCHEMAS)
        )
    if out is None:
        typer.echo(printable_json(json_text(schema_of(document))), nl=False)
        return
    write_json(out, schema_of(document))
    say_written(out)


def schema_of(name: str) -> dict[str, Any]:
    """The JSON schema of a document, one of `SCHEMAS`.

    Titles that only repeat a field's name are left out: an editor shows the description.
    """
    document = {"$schema": DIALECT, **resolve_name(SCHEMAS[name])(), "title": f"tunnel {name}"}
    return {key: _plain(value) if key != "title" else value for key, value in document.items()}


def _plain(value: Any) -> Any:
    """A schema without titles; a description from a docstring is reduced to its first line."""
    if isinstance(value, dict):
        kept = {
            key: _plain(part) for key, part in value.items() if not (key == "title" and isinstance(part, str))
        }
        if isinstance(text := kept.get("description"), str):
            kept["description"] = text.partition("\n")[0]
        return kept
    return [_plain(part) for part in value] if isinstance(value, list) else value
