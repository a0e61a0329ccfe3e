"""The golden set: all presentations of the same diagnoses, to show that a change of the code changes nothing.

Run as ``python -m benchmarks.golden write FOLDER``, ``faces FOLDER OUT`` or ``compare A B``; see README.md.
"""

from __future__ import annotations

import argparse
import contextlib
import difflib
import io
import json
import multiprocessing
import os
import re
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import takewhile
from pathlib import Path
from typing import Any

from benchmarks.golden_rigs import SEED, simulated
from diagnosis import diagnose, read_model
from diagnosis.findings.sections import printed
from diagnosis.model.joint import with_law
from diagnosis.result import Diagnosis
from identification import identify
from identification.examination.examine import examine
from identification.show.blocks import as_notebook, as_text
from tunnel_lab.experiments.blind.sets import make_blind
from tunnel_lab.report import render_report
from tunnel_lab.terminal.outputs import show
from tunnel_sim.engine.joint_model import JointModel
from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

SHARED = Path("../shared/data")
ROOMS = ("foreign", "measured", "driven", "faults/slips")
"""Folders of campaigns in the shared data."""
LONG = ("driven-emps", "driven-silverbox")
"""Campaigns that take more than a minute of processor time: only with ``--all``."""
SEALED = 40
VARYING = ("versions", "sha256")
"""The part of a document's provenance that depends on the machine and the day."""
MODEL, JOINT = "model.xml", "elbow"
"""A campaign with this file beside it is diagnosed with this joint of the model."""
Document = dict[str, Any]


def normalised(document: Document) -> Document:
    """The document without what differs from run to run: seconds, versions and hashes of the provenance."""
    rest = {key: value for key, value in document.get("provenance", {}).items() if key not in VARYING}
    cleared = {key: empty for key, empty in (("seconds", {}), ("provenance", rest)) if key in document}
    return document | cleared


def faces(document: Document, campaign: Campaign) -> dict[str, str]:
    """All presentations of a normalised document, by file name."""
    answer, shown = Diagnosis.from_json_dict(document), io.StringIO()
    blocks = printed(answer)
    with contextlib.redirect_stdout(shown):
        show(blocks)
    return {
        "text.txt": as_text(blocks),
        "printed.txt": shown.getvalue(),
        "notebook.html": as_notebook(blocks),
        "report.html": render_report(answer, campaign),
    }


def answers(folder: Path) -> dict[str, str]:
    """All files of a campaign; the text of a refusal is also an answer."""
    found, campaign = {}, read_campaign(folder)
    try:
        diagnosis = diagnose(campaign, model=own_model(folder, campaign))
        document = normalised(diagnosis.to_json_dict())
        found = {"document.json": as_json(document), **faces(document, diagnosis.data or campaign)}
        if diagnosis.model is not None:
            with tempfile.TemporaryDirectory() as room:
                found["patch.xml"] = diagnosis.model.write(Path(room) / "patch.xml").read_text("utf-8")
    except Exception as error:  # of any kind: a fault of one campaign does not end the set
        found["refusal.txt"] = refused(error)
    try:
        estimate = identify(campaign)
        found["estimate.json"] = as_json(normalised(estimate.to_json_dict()))
        found["estimate.txt"], found["estimate.html"] = str(estimate), estimate._repr_html_()
    except Exception as error:
        found["estimate-refusal.txt"] = refused(error)
    return found


def refused(error: Exception) -> str:
    """A refusal in its words; any other error with its type."""
    return f"{error}\n" if isinstance(error, TunnelError) else f"{type(error).__name__}: {error}\n"


def faces_again(recorded: Path, folder: Path) -> dict[str, str]:
    """The presentations of a recorded document, with the runs of its diagnosis."""
    file = recorded / "document.json"
    if not file.exists():
        return {}
    campaign = read_campaign(folder)
    if (own := own_model(folder, campaign)) is not None:
        campaign = with_law(campaign, own.law)[0]
    return faces(json.loads(file.read_text("utf-8")), examine(campaign).campaign)


def own_model(folder: Path, campaign: Campaign) -> JointModel | None:
    """The model beside the campaign; None if there is none."""
    return read_model(folder / MODEL, JOINT, campaign) if (folder / MODEL).exists() else None


def as_json(document: Document) -> str:
    """A document as indented JSON, in its order."""
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def make_campaigns(folder: Path) -> None:
    """Write the missing simulated campaigns and blind sets."""
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
    return {
        name: path for name, path in found.items() if re.search(only, name) and (whole or name not in LONG)
    }


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
    """The changed lines, cut because lines of a page are long.

    Each begins shortly before the first difference of its hunk.
    """
    found: list[str] = []
    for kind, a, b, c, d in difflib.SequenceMatcher(None, old, new, autojunk=False).get_opcodes():
        if kind != "equal":
            both = zip(*(next(iter(lines), "") for lines in (old[a:b], new[c:d])), strict=False)
            start = max(sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], both)) - 40, 0)
            found += [f"- {line[start : start + width]}" for line in old[a:b]]
            found += [f"+ {line[start : start + width]}" for line in new[c:d]]
    return found


def compare(one: Path, other: Path, lines: int) -> int:
    """Print for each campaign and file whether it is unchanged, and return the number of differences.

    For folders of ``faces``, which have no documents, only the files that both have are compared.
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
    parser.add_argument("--only", default="", metavar="PATTERN", help="campaigns whose names match this")
    parser.add_argument("--all", action="store_true", help="also the longest: " + ", ".join(LONG))
    parser.add_argument("--lines", type=int, default=6, help="of each difference (default: 6)")
    asked = parser.parse_args(given)
    if asked.what != "write" and asked.out is None:
        parser.error(f"{asked.what} needs two folders")
    if asked.what != "write" and not any(asked.folder.glob("*/*.*")):
        parser.error(f"{asked.folder}: no campaign is recorded here; write it first")
    if asked.what == "compare" and not asked.out.is_dir():
        parser.error(f"{asked.out}: no such folder; write it first")
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
