"""The golden set: all faces of the same diagnoses, so that a change of the code can be shown to change nothing.

Run as ``python -m benchmarks.golden write FOLDER``, ``faces FOLDER OUT`` or ``compare A B``; see README.md beside it.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import io
import json
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from diagnosis import diagnose, read_model
from diagnosis.model.joint import with_law
from diagnosis.words.sections import printed
from identification import identify
from identification.blocks import as_notebook, as_text
from identification.examination.examine import examine
from tests.reference import free_decays
from tests.reference.robot_joints import LEVEL, robot, robot_campaign
from tests.support.driven_runs import Planted, driven
from tests.support.robots import RUBS, TRUE
from tunnel_lab.experiments.blind.sets import make_blind
from tunnel_lab.report import render_report
from tunnel_lab.terminal.outputs import show
from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.vocabulary.campaign import Campaign, Quantity, RigProperties
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

SHARED = Path("../shared/data")
ROOMS = ("foreign", "measured", "driven", "faults/slips")
"""Folders of campaigns in the shared data."""
LONG = ("driven-emps", "driven-silverbox")
"""Campaigns that take more than a minute of processor time: only with ``--all``."""
SEALED, SEED = 40, 71
VARYING = ("versions", "sha256")
"""What the provenance of a document has of the machine and the day."""
MODEL, JOINT = "model.xml", "elbow"
"""A campaign with this file beside it is diagnosed with this joint of the model."""
Document = dict[str, Any]


def normalised(document: Document) -> Document:
    """The document without what differs from run to run: seconds, versions and hashes of the provenance."""
    rest = {key: value for key, value in document.get("provenance", {}).items() if key not in VARYING}
    cleared = {key: empty for key, empty in (("seconds", {}), ("provenance", rest)) if key in document}
    return document | cleared


def faces(document: Document, campaign: Campaign) -> dict[str, str]:
    """What a person is shown of a normalised document, by the name of its file."""
    blocks, shown = printed(document), io.StringIO()
    with contextlib.redirect_stdout(shown):
        show(blocks)
    return {
        "text.txt": as_text(blocks),
        "printed.txt": shown.getvalue(),
        "notebook.html": as_notebook(blocks),
        "report.html": render_report(document, campaign),
    }


def answers(folder: Path) -> dict[str, str]:
    """All files of a campaign; the text of a refusal is an answer too."""
    found, campaign = {}, read_campaign(folder)
    try:
        diagnosis = diagnose(campaign, model=own_model(folder, campaign))
        document = normalised(diagnosis.to_json_dict())
        found = {"document.json": as_json(document), **faces(document, diagnosis.data or campaign)}
        if diagnosis.model is not None:
            with tempfile.TemporaryDirectory() as room:
                found["patch.xml"] = diagnosis.model.write(Path(room) / "patch.xml").read_text("utf-8")
    except TunnelError as error:
        found["refusal.txt"] = str(error)
    try:
        estimate = identify(campaign)
        found["estimate.json"] = as_json(normalised(estimate.to_json_dict()))
        found["estimate.txt"], found["estimate.html"] = str(estimate), estimate._repr_html_()
    except TunnelError as error:
        found["estimate-refusal.txt"] = str(error)
    return found


def faces_again(recorded: Path, folder: Path) -> dict[str, str]:
    """The faces of a recorded document, with the runs as the diagnosis had them."""
    file = recorded / "document.json"
    if not file.exists():
        return {}
    campaign = read_campaign(folder)
    if (own := own_model(folder, campaign)) is not None:
        campaign = with_law(campaign, own.law)[0]
    return faces(json.loads(file.read_text("utf-8")), examine(campaign).campaign)


def own_model(folder: Path, campaign: Campaign) -> JointModel | None:
    """The model beside the campaign; None where there is none."""
    return read_model(folder / MODEL, JOINT, campaign) if (folder / MODEL).exists() else None


def as_json(document: Document) -> str:
    """Indented, in the order of the document."""
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def simulated() -> Iterator[tuple[str, Campaign, str]]:
    """Rigs beside the usual one: name, campaign, and MJCF of a model of one's own or nothing."""
    for name, joint, axis in (
        ("joint", TRUE, "0 0 1"),
        ("joint-rubs", RUBS, "0 0 1"),
        ("hangs", TRUE, LEVEL),
    ):
        xml = robot(joint, axis=axis)
        yield name, robot_campaign(xml), xml
    for kind, planted in (
        ("loose", Planted(friction=0.004)), ("loose, stated gain", Planted()), ("root", Planted(cubic=4.0)),
        ("turning base", Planted()), ("rates", Planted(friction=0.01)), ("moment", Planted(delay=0.02)),
        ("unknown gain", Planted(cubic=6.0)), ("no spring stated", Planted()), ("uneven", Planted()),
        ("moment, then released", Planted()),
    ):  # fmt: skip
        yield kind.replace(",", "").replace(" ", "-"), driven(kind, planted, seed=SEED), ""
    settings = free_decays.SIX
    still = [replace(one, speed=0.0) for one in settings]
    normal = [replace(one, spring=None) for one in settings if one.spring == 16.12]
    for name, chosen in (("still-air", still), ("normalised", normal), ("no-sizes", settings)):
        yield name, replace(decays(chosen), rig=RigProperties()), ""
    yield "gyro", reads(decays(settings), "rate", 2e-3), ""
    yield "accelerometer", reads(decays(settings), "acceleration", 5e-2), ""
    yield "limit-cycle", limit_cycles(decays(settings)), ""


def decays(settings: Any) -> Campaign:
    """Free decays of the nominal model in closed form, with noise."""
    rng = np.random.default_rng(SEED)
    made: Campaign = free_decays.campaign(settings, noise=4e-4, duration=8.0, rate=500.0, rng=rng)
    return made


def reads(campaign: Campaign, quantity: Quantity, noise: float) -> Campaign:
    """The same motions without their noise, read by another sensor with noise."""
    order, rng, runs = ("rate", "acceleration").index(quantity) + 1, np.random.default_rng(SEED), []
    for run in free_decays.campaign(free_decays.SIX, duration=8.0, rate=500.0).runs:
        clock = run.record.time_s
        values = CubicSpline(clock, run.record.yaw_rad).derivative(order)(clock)
        runs.append(replace(run, record=Record(clock, values + rng.normal(0.0, noise, clock.size))))
    sensor = replace(campaign.sensor, quantity=quantity, noise_std=noise, resolution=None)
    return replace(campaign, sensor=sensor, runs=tuple(runs))


def limit_cycles(campaign: Campaign) -> Campaign:
    """Growth to a limit cycle of 0.3 rad in every run with wind: β̈ − 2a(1 − (2β/A)²)β̇ + ω²β = 0."""

    def slope(_: float, state: Any, omega: float) -> list[float]:
        angle, rate = state
        return [rate, 0.8 * (1.0 - (2.0 * angle / 0.3) ** 2) * rate - omega**2 * angle]

    runs, rng, clock = [], np.random.default_rng(SEED), np.arange(15000) / 500.0
    for place, run in enumerate(run for run in campaign.runs if run.wind_on):
        start = (0.01, 0.0)
        solved = solve_ivp(slope, (0.0, 30.0), start, "DOP853", clock, args=(18.0 + place,), rtol=1e-8)
        runs.append(replace(run, record=Record(clock, solved.y[0] + rng.normal(0.0, 2e-4, clock.size))))
    return replace(campaign, runs=tuple(runs))


def make_campaigns(folder: Path) -> None:
    """Write the simulated campaigns and the blind sets that are not there yet."""
    for name, campaign, xml in simulated():
        place = folder / f"rig-{name}"
        if not place.exists():
            write_campaign(campaign, place)
            if xml:
                (place / MODEL).write_text(xml, "utf-8")
    if not (folder / "sealed").exists():
        make_blind(folder / "sealed", count=SEALED, seed=SEED)


def campaigns_of(made: Path, shared: Path, *, whole: bool, only: str) -> dict[str, Path]:
    """Folders of the set by name."""
    found = {}
    for room in ROOMS:
        for path in sorted((shared / room).glob("*/campaign.toml")):
            found[f"{room.rpartition('/')[2]}-{path.parent.name}"] = path.parent
    found |= {path.parent.name: path.parent for path in sorted(made.glob("rig-*/campaign.toml"))}
    found |= {f"sealed-{p.parent.name}": p.parent for p in sorted(made.glob("sealed/*/campaign.toml"))}
    return {name: path for name, path in found.items() if only in name and (whole or name not in LONG)}


def written(out: Path, work: Callable[[str, Path], dict[str, str]], job: tuple[str, Path]) -> str:
    """Write the files of a campaign, all or none, and return a line for the terminal."""
    name, folder = job
    begun = time.process_time()
    files = work(name, folder)
    with tempfile.TemporaryDirectory(dir=out, prefix=".") as part:
        (inner := Path(part) / name).mkdir()
        for file, text in files.items():
            (inner / file).write_text(text, "utf-8")
        inner.rename(out / name)
    return f"{name}: {len(files)} files, {time.process_time() - begun:.1f} s"


def _diagnosed(_: str, folder: Path) -> dict[str, str]:
    return answers(folder)


def _shown(recorded: Path, name: str, folder: Path) -> dict[str, str]:
    return faces_again(recorded / name, folder)


def changes(old: list[str], new: list[str], width: int = 160) -> list[str]:
    """Changed lines, each from shortly before the first difference of its hunk: lines of a page are long."""
    found: list[str] = []
    for kind, a, b, c, d in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if kind != "equal":
            start = (
                max(len(os.path.commonprefix([*old[a : a + 1], *new[c : c + 1]])) - 40, 0)
                if a < b and c < d
                else 0
            )
            found += [f"- {line[start : start + width]}" for line in old[a:b]]
            found += [f"+ {line[start : start + width]}" for line in new[c:d]]
    return found


def compare(one: Path, other: Path, lines: int) -> int:
    """Print for each campaign and file whether it is the same, and return the number of differences.

    Of a folder of ``faces``, which has no documents, only the files that both have are compared.
    """
    names = sorted({p.parent.name for folder in (one, other) for p in folder.glob("*/*.*") if p.is_file()})
    same = differing = 0
    for name in names:
        if not ((one / name).is_dir() and (other / name).is_dir()):
            print(f"{name}: only in {one if (one / name).is_dir() else other}")
            differing += 1
            continue
        mine, theirs = ({path.name for path in (folder / name).iterdir()} for folder in (one, other))
        whole = all({"document.json", "refusal.txt"} & files for files in (mine, theirs))
        for file in sorted(mine | theirs if whole else mine & theirs):
            paths = (one / name / file, other / name / file)
            texts = [path.read_text("utf-8") if path.exists() else "" for path in paths]
            if texts[0] == texts[1]:
                same += 1
                continue
            differing += 1
            print(f"{name}/{file}: differs")
            pair = [text.splitlines() for text in texts]
            for line in changes(*pair)[:lines]:
                print(f"    {line}")
    print(f"{len(names)} campaigns: {same} files same, {differing} differ")
    return differing


def main(given: list[str] | None = None) -> int:
    """Write, render again or compare; the exit status."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.golden", description=__doc__)
    parser.add_argument("what", choices=("write", "faces", "compare"))
    parser.add_argument("folder", type=Path, help="to write; with faces and compare: recorded before")
    parser.add_argument("out", type=Path, nargs="?", help="of faces: to write; of compare: the other")
    parser.add_argument("--campaigns", type=Path, help="the simulated ones (default: FOLDER/campaigns)")
    parser.add_argument("--shared", type=Path, default=SHARED, help=f"data (default: {SHARED})")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    parser.add_argument("--only", default="", help="campaigns whose names contain this")
    parser.add_argument("--all", action="store_true", help="also the longest: " + ", ".join(LONG))
    parser.add_argument("--lines", type=int, default=6, help="of each difference (default: 6)")
    asked = parser.parse_args(given)
    if asked.what != "write" and asked.out is None:
        parser.error(f"{asked.what} needs two folders")
    if asked.what == "compare":
        return int(compare(asked.folder, asked.out, asked.lines) > 0)
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "COLUMNS": "100"}
    made, out = asked.campaigns or asked.folder / "campaigns", asked.folder
    out.mkdir(parents=True, exist_ok=True)
    if asked.what == "write" and asked.campaigns is None:
        make_campaigns(made)
    jobs = campaigns_of(made, asked.shared, whole=asked.all or asked.what == "faces", only=asked.only)
    work: Callable[[str, Path], dict[str, str]] = _diagnosed
    if asked.what == "faces":
        out, work = asked.out, partial(_shown, asked.folder)
        out.mkdir(parents=True, exist_ok=True)
        jobs = {name: path for name, path in jobs.items() if (asked.folder / name).is_dir()}
    left = [(name, path) for name, path in jobs.items() if not (out / name).exists()]
    with ProcessPoolExecutor(asked.jobs, mp_context=multiprocessing.get_context("spawn")) as pool:
        for line in pool.map(partial(written, out, work), left):
            print(line, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
