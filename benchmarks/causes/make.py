"""Makes the set: campaigns by the reference simulator and the packaged records, a separate key, and the hashes of
both.

A set is a folder: ``campaigns/NAME`` (the only input of entries), ``seal.json`` (hashes of campaigns and key) and
``key/key.json`` (the truth). The hash of a campaign is over its numbers, not over the files of a Parquet library.
"""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Mapping
from functools import partial
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from benchmarks.causes.tracks import EDITIONS, REAL, VERSION, draw_all
from tunnel_lab.experiments.blind.sets import file_hash, write_document
from tunnel_sim.files.reading import read_json
from tunnel_sim.files.writing import output_folder
from tunnel_sim.processes import in_processes
from tunnel_sim.vocabulary.errors import TunnelError, counted

SEAL, KEY, CAMPAIGNS = "seal.json", "key/key.json", "campaigns"
CHUNK = 10  # campaigns simulated together; larger chunks are hardly faster


def published(version: int = VERSION) -> Path:
    """Place of the published seal of a version; the file need not exist yet."""
    return Path(__file__).parent / f"v{version}" / SEAL


def make(
    out: Path,
    *,
    version: int = VERSION,
    seed: int | None = None,
    counts: Mapping[str, int] | None = None,
    jobs: int = 1,
    salt: str | None = None,
) -> Path:
    """Make a set; an interrupted set is continued.

    Args:
        version: version of the set, a key of ``EDITIONS``.
        seed: seed of all random numbers; equal arguments give equal numbers. None: the seed of the version.
        counts: number of campaigns by track; None: the numbers of the version.
        salt: random text in the key, which prevents finding its hash by trying truths; None: derived from the
            seed, as in the published set, so that everyone can make its key.

    Returns:
        The seal's file.

    Raises:
        TunnelError: when the folder holds a finished set, or cannot be written to.
    """
    if (out / SEAL).exists():
        raise TunnelError("holds a finished set", where=str(out), remedy="name another folder")
    output_folder(out)
    edition = EDITIONS[version]
    seed = edition.seed if seed is None else seed
    counts = edition.counts if counts is None else counts
    drawn = draw_all(seed, counts)
    todo = [(i, seed, dict(counts)) for i in range(0, len(drawn), CHUNK)]
    (out / ".making").mkdir(exist_ok=True)
    for (first, *_), number in in_processes(partial(_make_chunk, out), todo, jobs if jobs > 1 else 0):
        print(f"campaigns {first + 1} to {first + number} of {len(drawn)}", flush=True)
    truths: dict[str, Any] = {}
    for first, *_ in todo:
        truths |= read_json(out / ".making" / f"{first}.json", remedy="make the set again")
    made_with = {"version": version, "seed": seed, "counts": dict(counts)}
    if edition.real and is_edition(made_with):  # not in sets of other seeds, on which methods are trained
        truths |= _copy_records(out / CAMPAIGNS)
    salt = hashlib.sha256(f"causes v{version} {seed}".encode()).hexdigest() if salt is None else salt
    (out / KEY).parent.mkdir(exist_ok=True)
    key = write_document(
        out / KEY, {"schema_version": 1, "salt": salt, "made_with": made_with, "truths": truths}
    )
    hashes = {name: data_hash(out / CAMPAIGNS / name) for name in sorted(truths)}
    write_document(out / SEAL, {"schema_version": 1, "key_sha256": key, "campaigns_sha256": hashes})
    shutil.rmtree(out / ".making")
    return out / SEAL


def is_edition(made_with: Mapping[str, Any]) -> bool:
    """Whether a set is one of ``EDITIONS``, not of another seed or with other numbers of campaigns.

    Args:
        made_with: arguments from the key of the set.
    """
    edition = EDITIONS[made_with["version"]]
    return made_with["seed"] == edition.seed and made_with["counts"] == edition.counts


def _make_chunk(out: Path, task: tuple[int, int, dict[str, int]]) -> int:
    """Simulate and write some campaigns; their number."""
    from tunnel_lab.experiments.blind.sets import written  # refused campaigns are redrawn, as in blind sets
    from tunnel_reference.make import simulate_set, truth_of

    first, seed, counts = task
    chunk = draw_all(seed, counts)[first : first + CHUNK]
    done = out / ".making" / f"{first}.json"
    if not done.exists():
        truths = {}
        for one, simulated in zip(chunk, simulate_set([one.draw for one in chunk]), strict=True):
            folder = out / CAMPAIGNS / one.name
            shutil.rmtree(folder, ignore_errors=True)
            truths[one.name] = {**truth_of(written(simulated, folder, False)), "track": one.track}
        write_document(done, truths)
    return len(chunk)


def _copy_records(target: Path) -> dict[str, Any]:
    """Copy the packaged measured records; their sources' verdicts by name."""
    from docs.studies.real_records import EXPECTED
    from identification.datasets import MEASURED_CAMPAIGNS

    truths = {}
    for name in MEASURED_CAMPAIGNS:
        with resources.as_file(resources.files("identification") / "data" / "measured" / name) as folder:
            shutil.copytree(folder, target / name, dirs_exist_ok=True)
        said = EXPECTED[name]
        truths[name] = {
            "track": REAL, "effects": sorted(said.causes), "small": sorted(said.also), "why": said.why,
        }  # fmt: skip
    return truths


def data_hash(folder: Path) -> str:
    """SHA-256 over the statements of a campaign and the numbers of its runs, in hexadecimal."""
    found = hashlib.sha256((folder / "campaign.toml").read_bytes())
    for path in sorted((folder / "runs").iterdir()):
        found.update(path.stem.encode() + b"\0")
        if path.suffix == ".parquet":
            table = pl.read_parquet(path)
            for column in sorted(table.columns):
                found.update(
                    column.encode() + np.ascontiguousarray(table[column].to_numpy(), dtype="<f8").tobytes()
                )
        else:
            found.update(path.read_bytes())
    return found.hexdigest()


def check(folder: Path, published: Path | None = None) -> dict[str, Any]:
    """Check a set against its seal, and open its key.

    Args:
        published: a seal with the required campaigns of the set; None: none. Its key may differ in the last
            digits of severities, which depend on the linear algebra library.

    Returns:
        The key's document.

    Raises:
        TunnelError: when a campaign or the key does not match the seal.
    """
    seal = read_json(folder / SEAL, remedy="make the set first: python -m benchmarks.causes make")
    if published is not None and (names := differing(seal, published)):
        number = f"{counted(len(names), 'campaign')} of {len(seal['campaigns_sha256'])}"
        what = f"{number} differ from the published set ({', '.join(names[:3])})"
        remedy = (
            "another processor or NumPy rounds otherwise: score them, and the result names these campaigns"
        )
        raise TunnelError(what, where=str(folder), remedy=remedy)
    for name, known in seal["campaigns_sha256"].items():
        if data_hash(folder / CAMPAIGNS / name) != known:
            raise TunnelError("is not the campaign that was sealed", where=name, remedy="make the set again")
    if file_hash(folder / KEY) != seal["key_sha256"]:
        raise TunnelError("is not the key that was sealed", where=str(folder / KEY), remedy="restore it")
    return read_json(folder / KEY, remedy="restore it")


def differing(seal: Mapping[str, Any], published: Path) -> list[str]:
    """Names of the campaigns with hashes that differ from the published ones.

    Args:
        published: file of the published seal of a version.
    """
    other, own = read_json(published, remedy="restore it")["campaigns_sha256"], seal["campaigns_sha256"]
    return sorted(name for name in {**other, **own} if other.get(name) != own.get(name))


def truths_by_track(key: Mapping[str, Any]) -> dict[str, list[str]]:
    """Names of campaigns by track, in the order of the tracks."""
    found: dict[str, list[str]] = {
        name: [] for name in (*(n for e in EDITIONS.values() for n in e.tracks), REAL)
    }
    for name, truth in key["truths"].items():
        found[truth["track"]].append(name)
    return {track: sorted(names) for track, names in found.items() if names}
