"""The files of the bench: campaigns in a folder, the files of each, and the stages that these files open."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import takewhile
from pathlib import Path
from typing import Any

from diagnosis.result import Diagnosis
from tunnel_lab.bench.work import work_of
from tunnel_sim.files.reading import CAMPAIGN_FILE, stem_of
from tunnel_sim.vocabulary.errors import TunnelError, one_line

_LONGEST = 80  # maximum number of characters of a file name
_LEAST_NAME = 3  # minimum number of characters of a name that files share
_RESERVED = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\.|$)", re.IGNORECASE)  # names of devices in Windows
ESTIMATOR = "output_error"
"""The estimator whose estimate opens the diagnosis."""
DIAGNOSIS = "diagnosis"
"""The name of the diagnosis among the commands."""


@dataclass(frozen=True)
class Session:
    """A campaign and the files beside it; the bench keeps no other state."""

    folder: Path
    name: str

    @property
    def campaign(self) -> Path:
        """Folder of the campaign, as every command takes it."""
        return self.folder / self.name

    @property
    def imported(self) -> bool:
        """Whether the campaign has been written."""
        return (self.campaign / CAMPAIGN_FILE).is_file()

    def state(self) -> tuple[tuple[str, int, int], ...]:
        """A fingerprint of the campaign's files: names, times and sizes (bytes)."""
        files = sorted(path for path in self.campaign.rglob("*") if path.is_file())
        return tuple((str(path), path.stat().st_mtime_ns, path.stat().st_size) for path in files)

    @property
    def uploads(self) -> Path:
        """Folder of the files as they were dropped."""
        return self._beside("uploads")

    @property
    def choices(self) -> Path:
        """The choices about the dropped files: a recipe, as for ``tunnel import --recipe``."""
        return self._beside("recipe.toml")

    @property
    def draft(self) -> Path:
        """Typed conditions that cannot be saved in the campaign yet."""
        return self._beside("draft.json")

    @property
    def uncertainties(self) -> Path:
        """Uncertainties of the inputs, as for ``tunnel identify --uncertainties``."""
        return self._beside("uncertainties.toml")

    @property
    def left_out(self) -> Path:
        """Ids of the runs that identify and diagnose leave out."""
        return self._beside("left-out.json")

    def estimate(self, estimator: str) -> Path:
        """The estimate by an estimator, as ``tunnel identify --json`` writes it."""
        return self._beside(f"{estimator}.json")

    @property
    def diagnosis(self) -> Path:
        """The diagnosis, as ``tunnel diagnose --json`` writes it."""
        return self._beside("diagnosis.json")

    @property
    def byline(self) -> Path:
        """Author and notes of the report."""
        return self._beside("byline.json")

    @property
    def report(self) -> Path:
        """The path of the report, one HTML page."""
        return self._beside("report.html")

    def log(self, work: str) -> Path:
        """The output of a command in a separate process."""
        return self._beside(f"{work}.log")

    def _beside(self, ending: str) -> Path:
        return self.folder / f"{self.name}.{ending}"


class UnknownCampaign(TunnelError):
    """An address names a campaign that the workspace does not have."""


def sessions(folder: Path) -> list[Session]:
    """The sessions of a workspace, by name: campaigns, and dropped files that are not one yet."""
    names = set()
    for path in _entries(folder):
        if (path / CAMPAIGN_FILE).is_file():
            names.add(path.name)
        elif path.name.endswith(".uploads") and path.is_dir():
            names.add(path.name.removesuffix(".uploads"))
    return [Session(folder, name) for name in sorted(names) if name == safe_name(name)]


def open_session(folder: Path, name: str) -> Session:
    """A session by the name in an address."""
    by_name = {session.name: session for session in sessions(folder)}
    if name not in by_name:
        what, remedy = f"there is no campaign '{one_line(name, 60)}'", "choose one on the first page"
        raise UnknownCampaign(what, where=str(folder), remedy=remedy)
    return by_name[name]


def common_name(file_names: Sequence[str]) -> str:
    """A name for a campaign of files: their folder's, or the common beginning of their names, or the first name."""
    paths = [re.split(r"[/\\]", unicodedata.normalize("NFKC", name)) for name in file_names]
    if len(paths) == 1:
        return safe_name(stem_of(Path(safe_name(paths[0][-1]))))
    folders = {tuple(path[:-1]) for path in paths}
    if len(folders) == 1 and (folder := folders.pop()) and folder[-1].strip("."):
        return safe_name(folder[-1])
    stems = [stem_of(Path(safe_name(path[-1]))) for path in paths]
    alike = takewhile(lambda letters: len(set(letters)) == 1, zip(*stems, strict=False))
    shared = "".join(letters[0] for letters in alike)
    # a part of a number, or a letter before differing numbers, is not a name
    whole = re.sub(r"[\W_]*(?:[^\W\d_]?\d*)?$", "", shared) if shared not in stems else shared
    return safe_name(whole) if len(whole) >= _LEAST_NAME else safe_name(stems[0])


def new_session(folder: Path, *file_names: str) -> Session:
    """A session for dropped files, named by their `common_name` or a variant not used in the workspace."""
    stem = common_name(file_names)
    taken = {path.name.split(".")[0].lower() for path in _entries(folder)}
    names = [stem, *(f"{stem}-{number}" for number in range(2, len(taken) + 3))]
    return Session(folder, next(name for name in names if name.lower() not in taken))


def rename(session: Session, name: str) -> Session:
    """Rename a session whose campaign has not been written.

    Raises:
        TunnelError: when the name is not valid, is taken, or the campaign has been written.
    """
    where = f"the name '{one_line(name, 60)}'"
    if session.imported:
        remedy = "rename it before it is written"
        raise TunnelError("the campaign has been written", where=where, remedy=remedy)
    if name != safe_name(name) or "." in name:
        remedy = f"use letters, digits, _, - and +, such as {safe_name(name).replace('.', '_')}"
        raise TunnelError("is not the name of a campaign", where=where, remedy=remedy)
    renamed = Session(session.folder, name)
    if name == session.name:
        return session
    if name.lower() in {path.name.split(".")[0].lower() for path in _entries(session.folder)}:
        raise TunnelError("is taken", where=where, remedy="choose another one")
    for before, after in ((session.uploads, renamed.uploads), (session.choices, renamed.choices)):
        if before.exists():
            before.rename(after)
    return renamed


def _entries(folder: Path) -> list[Path]:
    try:
        return list(folder.iterdir())
    except OSError as error:
        what = f"the folder cannot be read ({(error.strerror or str(error)).lower()})"
        raise TunnelError(what, where=str(folder), remedy="start tunnel bench again") from error


def safe_name(text: str) -> str:
    """A name that is a plain file of its folder on every system, whatever a browser sends.

    It has letters, digits, ``_``, ``-``, ``+`` and single dots, at most 85 of them; it is never empty, hidden or a
    device. A safe name stays as it is.
    """
    last = re.split(r"[/\\]", unicodedata.normalize("NFKC", text))[-1]
    plain = re.sub(r"[^\w.+-]+", "_", last)
    plain = re.sub(r"\.{2,}", ".", plain).strip("._-") or "file"
    stem, dot, ending = plain.rpartition(".")
    if dot and len(ending) < 10:
        plain = f"{stem[: _LONGEST - 1 - len(ending)]}.{ending}"
    plain = plain[:_LONGEST].strip("._-") or "file"
    return f"file-{plain}" if _RESERVED.match(plain) else plain


@dataclass(frozen=True)
class Stage:
    """A stage: its key in addresses, the title of its page, and the builder of the page in this package."""

    key: str
    title: str
    builder: str


STAGES = (
    Stage("records", "Records", "records.RecordsPage"),
    Stage("conditions", "Conditions", "conditions.ConditionsPage"),
    Stage("identify", "Identify", "identify.IdentifyPage"),
    Stage("diagnose", "Diagnose", "diagnosis.DiagnosePage"),
    Stage("next-run", "Next run", "diagnosis.build_next_run"),
    Stage("report", "Report", "diagnosis.ReportPage"),
)


def closed(session: Session, key: str) -> str:
    """The step to do before a stage can be opened, in one line; empty if the stage is open."""
    place = [stage.key for stage in STAGES].index(key)
    if place > 0 and not session.imported:
        return "Write the campaign on the page Records first."
    if place > 1 and session.draft.is_file():
        return "Correct the conditions that are marked first."
    if place > 2 and work_of(session.log(ESTIMATOR)).running:
        return f"{ESTIMATOR} is running; its estimate opens this stage."
    if place > 2 and not is_current(session, session.estimate(ESTIMATOR)):
        return f"Identify the campaign with {ESTIMATOR} first: the diagnosis starts from its estimate."
    if place > 2 and work_of(session.log(ESTIMATOR)).status == 1:
        return "The campaign could not be identified; the page Identify says why."
    if place > 3 and not is_current(session, session.diagnosis):
        running = work_of(session.log(DIAGNOSIS)).running
        return "The diagnosis is running." if running else "Diagnose the campaign first."
    return ""


def is_current(session: Session, result: Path) -> bool:
    """Whether a result belongs to the present state of the campaign."""
    document = read_result(result)
    if document is None:
        return False
    provenance = document.get("provenance")
    stated = provenance.get("sha256") if isinstance(provenance, dict) else None
    if stated is not None:  # a copied folder has new times but the same content
        return bool(stated == _hashes(session, session.state()))
    return max(changed for _, changed, _ in session.state()) <= result.stat().st_mtime_ns


@lru_cache(maxsize=16)
def _hashes(session: Session, _: object) -> dict[str, str]:
    """SHA-256 of the campaign's files; they are read again only when their state has changed."""
    from tunnel_lab.terminal.arguments import file_hashes

    return file_hashes(session.campaign)


def read_result(path: Path) -> dict[str, Any] | None:
    """The JSON document that a command has written; None if there is none."""
    from tunnel_sim.files.reading import read_json

    if not path.is_file():
        return None
    return read_json(path, remedy="delete it, and let the bench write it again")


def read_diagnosis(session: Session) -> Diagnosis | None:
    """The diagnosis as the page shows it; None if there is none.

    Raises:
        TunnelError: when the file was not written by this version's ``tunnel diagnose --json``.
    """
    from tunnel_lab.report import diagnosis_file

    return diagnosis_file.read_diagnosis(session.diagnosis) if session.diagnosis.is_file() else None
