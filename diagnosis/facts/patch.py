"""The user's model with the causes written into it, and the share of the gap that it explains by itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from diagnosis.facts.found import Fact
from diagnosis.settings import AnswerSettings
from tunnel_sim.files.writing import as_json

if TYPE_CHECKING:
    import mujoco

    from tunnel_sim.engine.joint_model import JointModel
    from tunnel_sim.engine.joint_patch import Written


@dataclass(frozen=True)
class NativeClosure:
    """The explained share of the gap on held-out readings.

    Args:
        before: mean squared residual of the nominal model, in units of a block mean's noise variance.
        fit: of the fits' own integrator with the causes, in the same unit.
        native: of the patched model, simulated by the engine, in the same unit.
        p_value: of the residual of the nominal model, a probability.
    """

    before: float
    fit: float
    native: float
    on: str
    p_value: float = 0.0

    @property
    def fit_closed(self) -> float:
        """Share of the gap that the fit explains."""
        return self._closed(self.fit)

    @property
    def native_closed(self) -> float:
        """Share of the gap that the patched model explains."""
        return self._closed(self.native)

    def _closed(self, after: float) -> float:
        return min(max(1.0 - max(after - 1.0, 0.0) / max(self.before - 1.0, 1e-9), 0.0), 1.0)


_OMISSIONS = frozenset({"rod", "friction against load", "friction against rate", "presliding", "air"})


@dataclass(frozen=True, eq=False)
class PatchedModel:
    """The model with the causes written into it.

    Args:
        written: attributes that changed.
        differences: where the native element follows another law, and causes left out.
        zero: the reading less the joint's position, rad; the median of the runs.
        notes: the differences in sentences; empty until they are written.
        native: the nearest model of MuJoCo's own elements; None where this one has no others.
    """

    model: JointModel
    spec: mujoco.MjSpec
    written: tuple[Written, ...]
    differences: tuple[Fact, ...]
    zero: float
    closure: NativeClosure
    notes: tuple[str, ...] = ()
    native: PatchedModel | None = None

    def judged(self, chosen: AnswerSettings) -> float | None:
        """Share of the gap that the patched model explains, as a judgement on the causes.

        Returns:
            None where its runs do not show the gap; or where a part of the causes cannot be written into the
            model, and the fit, which has that part, leaves next to nothing of the gap.
        """
        omits = any(fact.kind in _OMISSIONS for fact in self.differences)
        excused = omits and 1.0 - self.closure.fit_closed < chosen.patch_excused
        shown = self.closure.p_value < chosen.remains_rate
        return self.closure.native_closed if shown and not excused else None

    def write(self, path: Path | str) -> Path:
        """Write the patched model to an MJCF file, which it replaces, completely or not at all.

        MuJoCo reads a model with the plugin, which has a ``native`` one beside it, after `tunnel_sim.load_plugin`.

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
            "differences": as_json(self.differences),
            "closed": self.closure.native_closed,
            "closed_by_fit": self.closure.fit_closed,
            "closed_on": self.closure.on,
            "native": None
            if self.native is None
            else {"written": as_json(self.native.written), "closed": self.native.closure.native_closed},
        }
