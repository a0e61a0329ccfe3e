"""How far the gap closes and what more could be closed, with their JSON; and the model with the causes in it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagnosis.settings import RemainderSettings, settings_of
from identification.printing import TextTable, significant, unit_mark
from tunnel_sim.effects import known_effects
from tunnel_sim.files.writing import as_json

if TYPE_CHECKING:
    import mujoco

    from tunnel_sim.engine.joint_model import JointModel
    from tunnel_sim.engine.joint_patch import Written


@dataclass(frozen=True)
class Misfit:
    """What turns an excess into a misfit.

    Args:
        noise: standard deviation of one sample's noise, against which excesses are measured, in ``unit``.
        swing: root mean square of the readings about the mean of each run, in ``unit``.
        unit: of the readings: ``rad``, ``rad/s`` or ``rad/s2``.
    """

    noise: float
    swing: float
    unit: str

    def rms(self, excess: float) -> float:
        """Root mean square in ``unit`` of an excess in noise variances of a sample, which is chance below zero."""
        return self.noise * math.sqrt(max(excess, 0.0))


def unit_shown(unit: str) -> tuple[str, float]:
    """The mark of the unit in which readings are shown to people, and the factor on values in the unit given."""
    return {"rad": "°", "rad/s": "°/s", "rad/s2": "°/s²"}[unit], math.degrees(1.0)


def misfit_of(document: Mapping[str, Any]) -> Misfit | None:
    """The misfit of a diagnosis' document; None where it has none, as a document of an earlier version."""
    given = document["gap"].get("misfit")
    return None if given is None else Misfit(given["noise"], given["swing"], given["unit"])


def rms_shown(misfit: Misfit, excess: float) -> str:
    """A misfit to three digits, such as ``0.134°``.

    Args:
        excess: in noise variances of a sample, a ratio.
    """
    mark, factor = unit_shown(misfit.unit)
    value = factor * misfit.rms(excess)
    return f"{significant(value, 3) if value else '0'}{mark if mark == '°' else f' {mark}'}"


def of_swing(misfit: Misfit, excess: float) -> str:
    """A misfit as a share of the swing in words, such as ``2.1 % of the swing``.

    Args:
        excess: in noise variances of a sample, a ratio.
    """
    share = 100.0 * misfit.rms(excess) / misfit.swing if misfit.swing > 0.0 else 0.0
    return f"{significant(share, 2) if share else '0'} % of the swing"


def share_closed(before: float, after: float) -> float:
    """Share of a gap that closes, 0 to 1.

    Args:
        before: excess of the nominal model, in noise variances of a sample.
        after: excess with the causes, in noise variances of a sample.
    """
    return min(max(1.0 - max(after, 0.0) / before, 0.0), 1.0) if before > 0.0 else 0.0


@dataclass(frozen=True)
class Step:
    """The model with one more cause.

    Args:
        effect: name of the cause added; None for the nominal model.
        excess: with it and all causes before it, on readings held out of the fit, in noise variances of a sample.
    """

    effect: str | None
    excess: float


@dataclass(frozen=True)
class Waterfall:
    """How far the gap closes as the causes are added one after another.

    Args:
        steps: the nominal model first; then the cause that closes most, and so on.
        without: excess by cause, when it alone is taken out and the others are refitted, likewise held out. A cause
            beside a random moment has none: the random moment would absorb it.
    """

    steps: tuple[Step, ...] = ()
    without: Mapping[str, float] = field(default_factory=dict)
    held_out: str = ""

    def to_json_dict(self) -> dict[str, Any]:
        """The fields of a document: ``waterfall``, ``waterfall_on`` and ``without``."""
        return {
            "waterfall": as_json(self.steps),
            "waterfall_on": self.held_out,
            "without": dict(self.without),
        }


@dataclass(frozen=True)
class Move:
    """How far what remains moves a coefficient.

    Args:
        value: half the difference between the halves of the data that differ most, beyond chance, in ``unit``.
        relative: the same over the coefficient's absolute value, a fraction; None where the coefficient is zero.
        std: standard deviation stated for the coefficient, in ``unit``; None where the runs do not determine it.
    """

    value: float
    relative: float | None
    std: float | None
    unit: str


@dataclass(frozen=True)
class Remainder:
    """What remains after the named causes; the whole gap where none is named.

    Args:
        significant: whether it is beyond chance, by the tests of the gap.
        excess: on readings held out of the fit, in noise variances of a sample.
        p_value: of the strongest test, corrected for the number of tests.
        material: whether it is significant and moves a coefficient by more than its standard deviation or by 1 %.
    """

    significant: bool
    excess: float
    p_value: float
    material: bool
    moves: Mapping[str, Move]
    words: str


KINDS: Mapping[str, str] = {
    "angle": "a moment of the angle alone",
    "rate": "a moment of the rate alone",
    "state": "a moment of angle and rate",
    "wind": "a moment of angle and rate with the wind",
    "time": "a moment in time, alike in all runs",
    "reading": "an error of the reading, alike in all runs",
    "line": "a steady line in the reading, of a phase of its own in every run",
    "between": "a stiffness, damping or moment of each run's own",
    "event": "a moment in time of each run's own",
    "wander": "a wandering or jumping zero of each run's own",
    "noise": "nothing smooth: the rest is noise",
}
"""Kinds of what may be missing, in words; ``noise`` where none of the others closes much."""


@dataclass(frozen=True)
class Ceiling:
    """How much one kind could close at most.

    Args:
        closed: share of what is left, on readings held out of the fit; negative where the prediction is worse.
        std: its standard deviation from the scatter of the runs, a share.
    """

    kind: str
    closed: float
    std: float
    held_out: str

    def determined(self, chosen: RemainderSettings) -> bool:
        """Whether the share is known well enough; of a small excess, laws may close more than all."""
        return self.std < chosen.known_to and self.closed < chosen.closes_at_most


@dataclass(frozen=True)
class Curve:
    """The missing moment, or error of the reading, where it depends on one quantity or two.

    Args:
        over: the quantities: ``angle`` (rad), ``rate`` (rad/s) or ``time`` (s).
        values: at all places, the last quantity running fastest, in ``unit``. A part in proportion to angle or rate
            belongs to the model's own coefficients, and is taken out.
        std: their standard deviations, in ``unit``.
        unit: of values and standard deviations.
    """

    over: tuple[str, ...]
    places: tuple[tuple[float, ...], ...]
    values: tuple[float, ...]
    std: tuple[float, ...]
    unit: str


@dataclass(frozen=True)
class Law:
    """A formula that explains what is missing, fitted like any other effect.

    Args:
        effect: table of an effects file that states it.
        parameters: value and standard deviation by name, in the unit that the table states.
        closed: share of what is left that it closes, on runs held out of the fit.
        std: its standard deviation from the scatter of the runs, a share.
    """

    effect: Mapping[str, Any]
    parameters: Mapping[str, tuple[float, float]]
    closed: float
    std: float

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name; of the parameters ``value`` and ``std``."""
        parameters = {name: {"value": value, "std": std} for name, (value, std) in self.parameters.items()}
        found: dict[str, Any] = as_json({**vars(self), "parameters": parameters})
        return found


@dataclass(frozen=True)
class Closable:
    """What could be closed of what the answer leaves.

    Args:
        excess: that the answer leaves in the fitted runs, in noise variances of a sample.
        kind: the simplest that closes about as much as any, of `KINDS`.
        events: where a kind that differs from run to run lies: ``run``, its ``share``, ``from_s`` and ``to_s``.
        curve: of that kind; None where it has none.
    """

    excess: float
    ceilings: tuple[Ceiling, ...]
    kind: str
    words: str
    events: tuple[Mapping[str, Any], ...] = ()
    curve: Curve | None = None
    law: Law | None = None


def closable_words(document: Mapping[str, Any]) -> str:
    """What could be closed, in a line; empty where there is no gap, or it was not found."""
    if found := document.get("closable"):
        return f"What could be closed: {found['words']}"
    rest = document.get("rest")
    if not rest or not document["causes"]:
        return ""
    if not rest["significant"]:
        return f"What could be closed: nothing beyond chance (p = {rest['p_value']:.2g})."
    if any(kind.random for kind in known_effects() if kind.name in document["causes"]):
        return "What could be closed is not stated: beside a random moment any law would close something."
    return ""


def closable_table(document: Mapping[str, Any]) -> TextTable:
    """Share that each kind could close, in per cent; a table without rows where nothing remains beyond chance."""
    found, chosen = document.get("closable") or {"ceilings": ()}, settings_of(document).remainder
    rows = [
        (
            KINDS[one.kind],
            percent(max(one.closed, 0.0), one.std) if one.determined(chosen) else "not determined",
            one.held_out,
        )
        for one in (
            Ceiling(given["kind"], given["closed"], given["std"], given["held_out"])
            for given in found["ceilings"]
        )
    ]
    title = "Share of what is left that could be closed at most"
    return TextTable(title, ("by", "share", "held out"), tuple(rows), ("share",))


def percent(share: float, std: float | None = None) -> str:
    """A share in per cent, such as ``94.2 ± 0.6 %``.

    Args:
        share: a fraction.
        std: its standard deviation, a fraction.
    """
    beside = "" if std is None else f" ± {max(100.0 * std, 0.1):.1f}"
    return f"{min(100.0 * share, 100.0):.1f}{beside} %"


UNPATCHED = "The causes could not be written into the model"
"""How a caution begins where an answer has no patched model."""


@dataclass(frozen=True)
class NativeClosure:
    """How far the gap closes on readings held out of the fit.

    Args:
        before: mean squared residual of the nominal model, in units of the noise power of a block mean.
        fit: of the fits' own integrator with the causes, in the same unit.
        native: of the patched model, simulated by the engine, in the same unit.
    """

    before: float
    fit: float
    native: float
    on: str

    @property
    def fit_closed(self) -> float:
        """Share of the gap that the fit closes."""
        return self._closed(self.fit)

    @property
    def native_closed(self) -> float:
        """Share of the gap that the patched model closes."""
        return self._closed(self.native)

    def _closed(self, after: float) -> float:
        return min(max(1.0 - max(after - 1.0, 0.0) / max(self.before - 1.0, 1e-9), 0.0), 1.0)


@dataclass(frozen=True, eq=False)
class PatchedModel:
    """The model with the causes written into it.

    Args:
        written: attributes that changed.
        notes: where the native element is not the same law, in sentences.
        zero: the reading less the joint's position, rad; the median of the runs.
    """

    model: JointModel
    spec: mujoco.MjSpec
    written: tuple[Written, ...]
    notes: tuple[str, ...]
    zero: float
    closure: NativeClosure

    def write(self, path: Path | str) -> Path:
        """Write the patched model to an MJCF file, which it replaces, completely or not at all.

        Raises:
            TunnelError: when it cannot be written.
        """
        from tunnel_sim.engine.joint_patch import patched_xml
        from tunnel_sim.files.writing import write_whole

        target = Path(path)
        return write_whole(target, patched_xml(self.spec, self.model, target.parent).encode())

    def to_json_dict(self) -> dict[str, Any]:
        """The patch in JSON's types."""
        return {
            "file": self.model.path.name,
            "joint": self.model.joint,
            "free": list(self.model.law.free),
            "rest_rad": self.model.law.rest,
            "zero_rad": self.zero,
            "written": as_json(self.written),
            "notes": list(self.notes),
            "closed": self.closure.native_closed,
            "closed_by_fit": self.closure.fit_closed,
            "closed_on": self.closure.on,
        }


def patch_table(document: Mapping[str, Any]) -> TextTable:
    """What the patch changes; a table without rows where no model was given."""
    model = document.get("model") or {"written": (), "file": ""}
    rows = []
    for one in model["written"]:
        mark = "" if one["unit"] == "1" else unit_mark(one["unit"])
        rows.append((one["name"], _numbers(one["before"]), _numbers(one["after"]), mark))
    heads = ("", "before", "after", "")
    return TextTable(f"Changes to {model['file']}", heads, tuple(rows), ("before", "after"))


def patch_lines(document: Mapping[str, Any]) -> list[str]:
    """How far the patched model closes the gap, and each difference from the law found; none without a model."""
    model = document.get("model")
    if model is None:
        return []
    if document["causes"] in ([], ["unknown"]):
        said = f"No cause is written into the patched model, only what was free: {', '.join(model['free'])}."
    else:
        closed, by_fit = (f"{100.0 * model[name]:.1f} %" for name in ("closed", "closed_by_fit"))
        said = (
            f"The patched model, simulated by MuJoCo as it stands, closes {closed} of the gap "
            f"{model['closed_on']}; the fit itself {by_fit}."
        )
    reading = f"The reading is the position of {model['joint']} {model['zero_rad']:+.4g} rad."
    return [f"{said} {reading}", *(f"- {note}" for note in model["notes"])]


def _numbers(values: list[float]) -> str:
    last = max((i for i, value in enumerate(values) if value), default=0)
    return " ".join(significant(value, 4) for value in values[: last + 1])
