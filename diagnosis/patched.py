"""The answer as a model: the model given, with the causes written into it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from identification.printing import TextTable, significant, unit_mark
from tunnel_sim.files.writing import as_json

if TYPE_CHECKING:
    import mujoco

    from tunnel_sim.engine.joint_model import JointModel
    from tunnel_sim.engine.joint_patch import Written


UNPATCHED = "The causes could not be written into the model"
"""How a caution begins where an answer has no patched model."""


@dataclass(frozen=True)
class NativeClosure:
    """How far the gap closes on readings held out of the fit.

    Args:
        before: mean squared residual of the nominal model, in units of the noise power of a block mean.
        fit: of the fits' own integrator with the causes, in the same unit.
        native: of the patched model, simulated by the engine, in the same unit.
        on: what was held out, in words.
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
        spec: the patched specification.
        written: attributes that changed.
        notes: where the native element is not the same law, in sentences.
        zero: the reading less the joint's position, rad; the median of the runs.
        closure: of the patched model, simulated by the engine.
    """

    model: JointModel
    spec: mujoco.MjSpec
    written: tuple[Written, ...]
    notes: tuple[str, ...]
    zero: float
    closure: NativeClosure

    def write(self, path: Path | str) -> Path:
        """Write the patched model, completely or not at all.

        Args:
            path: of the MJCF file; replaced when it exists.

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
    """What the patch changes.

    Returns:
        A table; without rows where no model was given.
    """
    model = document.get("model") or {"written": (), "file": ""}
    rows = [
        (
            w["name"],
            _numbers(w["before"]),
            _numbers(w["after"]),
            "" if w["unit"] == "1" else unit_mark(w["unit"]),
        )
        for w in model["written"]
    ]
    return TextTable(
        f"Changes to {model['file']}", ("", "before", "after", ""), tuple(rows), ("before", "after")
    )


def patch_lines(document: Mapping[str, Any]) -> list[str]:
    """How far the patched model closes the gap, and where it is not the law found.

    Returns:
        A line, and one for each difference of the laws; none where no model was given.
    """
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
