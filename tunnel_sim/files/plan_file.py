"""Reading the plan of a campaign from a TOML file.

The packaged ``data/paper-campaign.toml`` is an example with a comment on every key.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from math import radians
from pathlib import Path

from tunnel_sim.files.plan_schema import PlanDocument, read_plan
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.files.toml_input import shown
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.plan import CampaignPlan, Condition, EffectSetting, SensorModel, Truth
from tunnel_sim.vocabulary.rig import Rig


def load_plan(path: Path | str, *, rig: Rig | None = None) -> CampaignPlan:
    """Read a campaign description.

    Args:
        path: a TOML file like the packaged ``paper-campaign.toml``.
        rig: defines the numbered springs, and the inertia, damping and air density that the description does not
            state; None uses the packaged rig.

    Returns:
        The plan: runs in the order springs, stiffnesses, then wind speeds, release angles and repeats.

    Raises:
        TunnelError: for the first fault, in one line that names file, key and remedy.
    """
    path = Path(path)
    return plan_from(read_plan(path), load_rig() if rig is None else rig, shown(path))


def plan_from(document: PlanDocument, rig: Rig, where: str) -> CampaignPlan:
    """The plan defined by a validated campaign description.

    Args:
        rig: as in `load_plan`.

    Raises:
        TunnelError: when the rig has no such spring.
    """
    stated = document.truth.model_dump(exclude_none=True)
    inertia, damping = rig.dynamics.yaw_inertia, rig.dynamics.mechanical_damping
    return CampaignPlan(
        name=document.name,
        description=document.description,
        seed=document.seed,
        truth=Truth(**({"yaw_inertia": inertia, "mechanical_damping": damping} | stated)),
        conditions=_conditions(document, rig, where),
        sensor=SensorModel(**document.sensor.model_dump(exclude_none=True)),
        effects=tuple(EffectSetting(effect.name, dict(effect.parameters)) for effect in document.effects),
    )


def paper_plan() -> CampaignPlan:
    """The paper's campaign (``data/paper-campaign.toml``): four springs, wind off and at three speeds."""
    with resources.as_file(resources.files("tunnel_sim") / "data" / "paper-campaign.toml") as path:
        return load_plan(path)


def _conditions(document: PlanDocument, rig: Rig, where: str) -> tuple[Condition, ...]:
    density = rig.air.density if document.air_density is None else document.air_density
    return tuple(
        Condition(
            id=f"{label}-v{_short(speed)}-a{_short(angle)}" + (f"-{repeat}" if document.repeats > 1 else ""),
            spring_stiffness=stiffness,
            wind_speed=speed,
            air_density=density,
            release_angle=radians(angle),
            duration=document.duration,
        )
        for label, stiffness in _stiffnesses(document, rig.springs, where)
        for speed in document.wind_speeds
        for angle in document.release_angles_deg
        for repeat in range(1, document.repeats + 1)
    )


def _stiffnesses(document: PlanDocument, springs: Mapping[int, float], where: str) -> list[tuple[str, float]]:
    """A label and the stiffness of every numbered spring and of every spring stated by its stiffness."""
    for number in document.springs:
        if number not in springs:
            raise TunnelError(
                f"there is no spring {number}",
                where=where,
                remedy=f"use one of {', '.join(map(str, springs))}, or give spring_stiffness in N m/rad",
            )
    numbered = [(f"s{number}", springs[number]) for number in document.springs]
    return numbered + [(f"k{_short(stiffness)}", stiffness) for stiffness in document.spring_stiffness]


def _short(value: float) -> str:
    """The shortest text that represents a number uniquely: ``15``, ``16.12``."""
    return repr(value + 0.0).removesuffix(".0")  # + 0.0: minus zero is zero
