"""``tunnel doctor``: what is installed, and whether it works."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from tunnel_sim.vocabulary.plan import CampaignPlan

NAME = "doctor"
PACKAGES = ("mujoco", "numpy", "scipy", "torch", "gymnasium", "polars", "matplotlib")
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
LARGEST_ERROR = 5.0  # standard deviations by which the self-check may miss the truth
_COMPILER_S = 5.0


def run() -> None:
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
    from tunnel_lab.terminal.tables import show_tables, table

    rows = table("Installation", "part", "found")
    for part, text in (*versions(), *native(), *machine(), *extras()):
        rows.add_row(part, text)
    checks = table("Self-check", "check", "result")
    works = True
    for part, text, fine in self_check():
        checks.add_row(part, text if fine else f"FAILED: {text}")
        works = works and fine
    show_tables(rows, checks)
    if not works:
        raise typer.Exit(1)


def versions() -> Iterator[tuple[str, str]]:
    """The program, Python, the system and the packages."""
    from importlib.metadata import PackageNotFoundError, version

    def of(name: str) -> str:
        try:
            return version(name)
        except PackageNotFoundError:
            return "not installed"

    yield "tunnel", of("virtual-wind-tunnel")
    yield "Python", f"{platform.python_version()} ({sys.executable})"
    yield "system", f"{platform.system()} {platform.release()}, {platform.machine()}"
    yield from ((name, of(name)) for name in PACKAGES)


def native() -> Iterator[tuple[str, str]]:
    """Compiler and compiled libraries."""
    from tunnel_sim.physics.moment_law import native_library
    from tunnel_sim.vocabulary.errors import TunnelError

    yield "C compiler", compiler()
    try:
        yield "plugin", str(native_library("vwt_plugin"))
    except TunnelError as error:
        yield "plugin", str(error)


def compiler() -> str:
    """The C compiler that an installation from source would use, and its version."""
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


def machine() -> Iterator[tuple[str, str]]:
    """Processors, and the variables that limit threads."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    yield "processors", f"{usable} usable of {os.cpu_count()}"
    limits = [f"{name}={os.environ[name]}" for name in THREADS if name in os.environ]
    yield "thread limits", ", ".join(limits) or "none set"


def extras() -> Iterator[tuple[str, str]]:
    """The extras and what each lacks."""
    from importlib.util import find_spec

    from tunnel_sim.vocabulary.errors import EXTRAS

    for extra, modules in EXTRAS.items():
        missing = [name for name in modules if find_spec(name) is None]
        remedy = f"pip install 'virtual-wind-tunnel[{extra}]'"
        yield f"extra {extra}", f"lacks {', '.join(missing)}: {remedy}" if missing else "installed"


def self_check() -> Iterator[tuple[str, str, bool]]:
    """Simulate and identify a small campaign.

    Yields:
        What was checked, the result in words, and whether it is as it should be.
    """
    begun = time.perf_counter()
    try:
        from identification import identify
        from tunnel_sim import simulate_campaign

        plan = small_plan()
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


def small_plan() -> CampaignPlan:
    """Four of the paper's runs, cut off after 5 s."""
    from dataclasses import replace

    from tunnel_sim.files.plan_file import paper_plan

    plan = paper_plan()
    return replace(plan, conditions=tuple(replace(run, duration=5.0) for run in plan.conditions[:4]))
