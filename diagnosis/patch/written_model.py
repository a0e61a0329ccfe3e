"""The user's model with the causes written into it, and the share of the gap that it explains by itself."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

from diagnosis.model.fact import Fact
from diagnosis.patch.native_friction import ON_ACTUATOR
from diagnosis.settings import AnswerSettings
from tunnel_sim.files.from_json import UNWRITTEN
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.rig import WrittenAttribute

if TYPE_CHECKING:
    import mujoco

    from tunnel_sim.engine.joint_model import JointModel

LAW_LEAVES: Final = 0.001
"""Unexplained share of the gap below which a law of friction under load counts as right; and below which a part
of the causes that cannot be written into the user's model excuses the patched model. Judgement. In simulated
joints a right law leaves 0.0001, a wrong one 0.002 or more."""


@dataclass(frozen=True)
class NativeClosure:
    """The explained share of the gap on held-out readings.

    Args:
        before: mean squared residual of the nominal model, in units of a block mean's noise variance.
        fit: residual of the fits' own integrator with the causes, in the same unit.
        native: residual of the patched model, simulated by the engine, in the same unit.
        p_value: p-value of the residual of the nominal model.
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


_OMISSIONS = frozenset({"rod", "air"})


@dataclass(frozen=True, eq=False)
class EngineModel:
    """A patched model in the engine.

    Args:
        given: the user's model.
        spec: the model with the causes written into it.
        closure: share of the gap explained in simulations with it.
    """

    given: JointModel
    spec: mujoco.MjSpec
    closure: NativeClosure

    def write(self, path: Path | str) -> Path:
        """Write the model to an MJCF file, which it replaces, completely or not at all.

        Raises:
            TunnelError: when it cannot be written.
        """
        from tunnel_sim.engine.joint_patch import patched_xml
        from tunnel_sim.files.writing import write_whole

        target = Path(path)
        return write_whole(target, patched_xml(self.spec, self.given, target.parent).encode())


@dataclass(frozen=True)
class NativeForm:
    """The nearest model of MuJoCo's own elements alone.

    Args:
        written: changed attributes.
        closed: share of the gap on held-out readings that it explains, simulated by the engine.
        engine: the model itself, which is not part of the JSON; None if read from a file.
    """

    written: tuple[WrittenAttribute, ...]
    closed: float
    engine: Annotated[EngineModel | None, UNWRITTEN] = field(default=None, compare=False, repr=False)

    def write(self, path: Path | str) -> Path:
        """As `PatchedModel.write`."""
        return _written(self.engine, path)

    def to_json_dict(self) -> dict[str, Any]:
        """The fields except ``engine``."""
        return {"written": as_json(self.written), "closed": self.closed}


@dataclass(frozen=True)
class PatchedModel:
    """The model with the causes written into it.

    Args:
        file: name of the given model's file.
        joint: the recorded joint.
        free: fitted parameters of the nominal model.
        rest_rad: position of the joint from which the law measures angles, rad.
        zero_rad: the reading less the joint's position, rad; the median of the runs.
        written: changed attributes.
        differences: differences between a native element and the law, and causes left out.
        closed: share of the gap on held-out readings that the model explains, simulated by the engine.
        closed_by_fit: share that the fit explains.
        closed_on: the held-out readings.
        notes: the differences in sentences; empty until they are written.
        native: the nearest model of MuJoCo's own elements alone; None where this model has no others.
        engine: the model itself, which is not part of the JSON; None if read from a file.
    """

    file: str
    joint: str
    free: tuple[str, ...]
    rest_rad: float
    zero_rad: float
    written: tuple[WrittenAttribute, ...]
    notes: tuple[str, ...]
    differences: tuple[Fact, ...]
    closed: float
    closed_by_fit: float
    closed_on: str
    native: NativeForm | None = None
    engine: Annotated[EngineModel | None, UNWRITTEN] = field(default=None, compare=False, repr=False)

    @classmethod
    def of(
        cls,
        engine: EngineModel,
        written: tuple[WrittenAttribute, ...],
        differences: tuple[Fact, ...],
        zero: float,
    ) -> PatchedModel:
        """The patched model with its closure.

        Args:
            zero: the reading less the joint's position, rad.
        """
        given, closure = engine.given, engine.closure
        return cls(
            file=given.path.name,
            joint=given.joint,
            free=tuple(given.law.free),
            rest_rad=given.law.rest,
            zero_rad=zero,
            written=written,
            notes=(),
            differences=differences,
            closed=closure.native_closed,
            closed_by_fit=closure.fit_closed,
            closed_on=closure.on,
            engine=engine,
        )

    def judged(self, chosen: AnswerSettings) -> float | None:
        """Share of the gap that the patched model explains, for judging the causes.

        Returns:
            None where the runs do not show the gap. Also None if a part of the causes cannot be written into
            the model, and the fit, which includes that part, leaves next to nothing of the gap.
        """
        kinds = {fact.kind for fact in self.differences}
        excused = kinds & _OMISSIONS and 1.0 - self.closed_by_fit < LAW_LEAVES
        return self.closed if self._shown(chosen) and not excused else None

    def under_load(self, chosen: AnswerSettings) -> float | None:
        """Unexplained share of the gap with friction that depends on the moment of an actuator.

        Returns:
            None without such friction, or if the fit leaves next to nothing, as only a right law does. Friction
            under the mean load explains most of a gap whatever the law is.
        """
        loaded = any(fact.figures.get("moment") == ON_ACTUATOR for fact in self.differences)
        left = 1.0 - self.closed_by_fit
        return left if self._shown(chosen) and loaded and left >= LAW_LEAVES else None

    def _shown(self, chosen: AnswerSettings) -> bool:
        """Whether the runs of the comparison show the gap."""
        return self.engine is not None and self.engine.closure.p_value < chosen.remains_rate

    def write(self, path: Path | str) -> Path:
        """Write the patched model to an MJCF file, which it replaces, completely or not at all.

        After `tunnel_sim.load_plugin`, MuJoCo can read a model that uses the plugin; it has a ``native`` model
        beside it.

        Raises:
            TunnelError: when it cannot be written, or the answer was read from a file.
        """
        return _written(self.engine, path)

    def to_json_dict(self) -> dict[str, Any]:
        """The fields except ``engine``."""
        return {name: as_json(value) for name, value in vars(self).items() if name != "engine"}


def _written(engine: EngineModel | None, path: Path | str) -> Path:
    if engine is None:
        raise TunnelError(
            "an answer from a file does not hold its model", remedy="diagnose the campaign again"
        )
    return engine.write(path)
