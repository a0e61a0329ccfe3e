"""The plan of a campaign: the tables of its TOML file, and their reader; and the tables of an effects file.

The packaged ``data/paper-campaign.toml`` is an example with a comment on every key.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Iterator
from importlib import resources
from itertools import count
from math import radians
from pathlib import Path
from typing import Annotated, Literal, Protocol, TypeVar

import numpy as np
from pydantic import AfterValidator, Field

from tunnel_sim.files.plan_input import InputTable, check_input_table, input_of_file, input_of_run
from tunnel_sim.files.reading import check_count
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.files.scatter_tables import RepeatabilityTable, ScatterTable
from tunnel_sim.files.toml_input import (
    NotNegative,
    OneLine,
    Positive,
    SampleRate,
    StrictModel,
    load_toml,
    optional,
    shown,
    validate,
)
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import Motion
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.plan import (
    DEFAULT_SAMPLE_RATE,
    CampaignPlan,
    Condition,
    EffectSetting,
    SensorModel,
    Truth,
)
from tunnel_sim.vocabulary.rig import Rig

STEPS_PER_SECOND = 1000.0
"""Integration steps per second of a run."""


def _release_angle(angle: float) -> float:
    if not 0.0 < abs(angle) <= 180.0:
        raise ValueError("is not a release angle in degrees: it is zero or greater than 180")
    return angle


HashableT = TypeVar("HashableT", bound=Hashable)
ReleaseAngle = Annotated[float, AfterValidator(_release_angle)]

Springs = Annotated[list[int], Field(description="a list of spring numbers of Table II, such as [5, 6]")]
Stiffnesses = Annotated[list[Positive], Field(description="a list of positive numbers in N m/rad")]
WindSpeeds = Annotated[
    list[NotNegative],
    Field(min_length=1, description="a list of speeds in m/s, 0 for wind-off, such as [0, 10]"),
]
ReleaseAngles = Annotated[
    list[ReleaseAngle], Field(min_length=1, description="a list of angles in degrees, such as [20]")
]
FreeDecays = Annotated[
    list[ReleaseAngle],
    Field(
        description="a list of angles in degrees, such as [20]; it may be left out where a [drive] is given"
    ),
]
Repeats = Annotated[int, Field(ge=1, le=1000, description="a whole number from 1 to 1000")]


class TruthTable(StrictModel):
    """``[truth]``."""

    cn_beta: float = Field(description="a number, 1/rad")
    cn_r: float = Field(description="a number, 1/rad")
    yaw_inertia: Positive | None = optional("a positive number in kg m2")
    mechanical_damping: NotNegative | None = optional("a number in N m s/rad, zero or more")


class SensorModelTable(StrictModel):
    """``[sensor]``; omitted keys take the defaults of ``SensorModel``."""

    sample_rate: SampleRate | None = optional("a positive number in Hz")
    noise_std: NotNegative | None = optional("a number in rad, zero or more")
    resolution: NotNegative | None = optional("a number in rad, zero for none")
    zero: float | None = optional("a number in rad")


class EffectTable(StrictModel):
    """``[[effects]]``."""

    name: OneLine = Field(description="the name of an effect in quotes")
    parameters: dict[str, float] = Field(default={}, description="a table of numbers, such as { x = 0.1 }")


class PlanDocument(StrictModel):
    """The whole of a campaign description: springs × speeds × (release angles and driven runs) × repeats."""

    name: OneLine = Field(description="a short name in quotes")
    description: str = Field(default="", description="text in quotes, or leave it out")
    seed: int = Field(ge=0, description="a whole number, zero or more")
    springs: Springs = Field(default=[])
    spring_stiffness: Stiffnesses = Field(default=[])
    wind_speeds: WindSpeeds
    release_angles_deg: FreeDecays = Field(default=[])
    repeats: Repeats = 1
    duration: Positive = Field(description="a positive number in s")
    air_density: Positive | None = optional("a positive number in kg/m3")
    truth: TruthTable = Field(description="a [truth] table with cn_beta and cn_r")
    sensor: SensorModelTable = Field(default=SensorModelTable(), description="a [sensor] table")
    scatter: ScatterTable = Field(default=ScatterTable(), description="a [scatter] table")
    repeatability: RepeatabilityTable = Field(
        default=RepeatabilityTable(), description="a [repeatability] table"
    )
    drive: InputTable | None = optional("a [drive] table with kind and amplitudes")
    effects: list[EffectTable] = Field(default=[], description="[[effects]] tables")

    @property
    def sample_rate(self) -> float:
        """Hz."""
        return DEFAULT_SAMPLE_RATE if self.sensor.sample_rate is None else self.sensor.sample_rate

    @property
    def samples(self) -> int:
        """The number of samples in a run (a count)."""
        return max(2, round(self.duration * self.sample_rate))


def read_plan(path: Path) -> PlanDocument:
    """Read and validate a campaign description."""
    document = load_toml(path, missing="name a campaign description such as the packaged paper-campaign.toml")
    plan = validate(PlanDocument, document, path)
    check_conditions(plan, shown(path))
    driven = 0 if plan.drive is None else len(plan.drive.amplitudes)
    if not plan.release_angles_deg and plan.drive is None:
        remedy = "give release_angles_deg as a list of angles in degrees, such as [20], or a [drive]"
        raise TunnelError("'release_angles_deg' is empty or missing", where=shown(path), remedy=remedy)
    check_size(run_count(plan, driven), plan.duration, plan.sample_rate, shown(path))
    if plan.drive is not None:
        check_input_table(plan.drive, plan.samples, plan.sample_rate, f"{shown(path)}, [drive]")
    return plan


class ConditionKeys(Protocol):
    """The keys whose values are combined into a campaign's runs, in N m/rad, m/s and degrees."""

    springs: list[int]
    spring_stiffness: list[float]
    wind_speeds: list[float]
    release_angles_deg: list[float]
    repeats: int


def run_count(keys: ConditionKeys, driven: int = 0) -> int:
    """The number of runs of a table of lists, with some driven runs of each spring and speed before repeats."""
    springs = len(keys.springs) + len(keys.spring_stiffness)
    return springs * len(keys.wind_speeds) * (len(keys.release_angles_deg) + driven) * keys.repeats


def check_size(runs: int, duration: float, sample_rate: float, where: str) -> None:
    """Refuse a campaign that is too large to simulate or to read again, before it is expanded.

    Args:
        duration: duration of each run, s.
        sample_rate: sample rate, Hz.
    """
    check_count(runs, limits.CAMPAIGN_RUNS, "runs", where, "shorten a list, or make several campaigns")
    # Even the shortest run has two samples.
    samples = max(2.0, duration * sample_rate)
    lower = "give a shorter duration or a lower sample_rate"
    check_count(samples, limits.RUN_SAMPLES, "samples in a run", where, lower)
    fewer = "make several campaigns, or give a shorter duration"
    check_count(runs * samples, limits.CAMPAIGN_SAMPLES, "samples in the campaign", where, fewer)
    steps = runs * samples / sample_rate * STEPS_PER_SECOND
    check_count(steps, limits.CAMPAIGN_STEPS, "integration steps in the campaign", where, fewer)


def first_twice(values: Iterable[HashableT]) -> HashableT | None:
    """The first value that occurs a second time; None if all differ."""
    seen: set[HashableT] = set()
    for value in values:
        if value in seen:
            return value
        seen.add(value)
    return None


def check_conditions(plan: ConditionKeys, where: str) -> None:
    """Refuse conditions that give no runs, or the same run twice."""
    if not plan.springs and not plan.spring_stiffness:
        remedy = "give springs (numbers) or spring_stiffness (N m/rad)"
        raise TunnelError("no spring", where=where, remedy=remedy)
    for key in ("springs", "spring_stiffness", "wind_speeds", "release_angles_deg"):
        twice = first_twice(getattr(plan, key))
        if twice is not None:
            remedy = "leave one out, and use repeats for more runs"
            raise TunnelError(f"{key} holds {twice:g} twice", where=where, remedy=remedy)


def load_plan(path: Path | str, *, rig: Rig | None = None) -> CampaignPlan:
    """Read a campaign description.

    Args:
        path: a TOML file like the packaged ``paper-campaign.toml``.
        rig: defines the numbered springs, and the inertia, damping and air density that the description does not
            state; None: the packaged rig.

    Returns:
        The plan: runs in the order springs, stiffnesses, then wind speeds, release angles, amplitudes of the
            drive and repeats.

    Raises:
        TunnelError: for the first fault, in one line that names file, key and remedy.
    """
    path = Path(path)
    return plan_from(read_plan(path), load_rig() if rig is None else rig, shown(path), path.parent)


def plan_from(document: PlanDocument, rig: Rig, where: str, folder: Path = Path()) -> CampaignPlan:
    """The plan from a validated campaign description; the folder is searched for a file for the drive."""
    table, time, numbers = document.drive, np.arange(document.samples) / document.sample_rate, count()
    given = None
    if table is not None and table.file is not None:
        given = input_of_file(folder / table.file, time, table, f"{where}, [drive] file '{table.file}'")
    for number in document.springs:
        if number not in rig.springs:
            remedy = f"use one of {', '.join(map(str, rig.springs))}, or give spring_stiffness in N m/rad"
            raise TunnelError(f"there is no spring {number}", where=where, remedy=remedy)
    springs = [(f"s{number}", rig.springs[number]) for number in document.springs]
    springs += [(f"k{_short(stiffness)}", stiffness) for stiffness in document.spring_stiffness]

    def starts() -> Iterator[tuple[str, float, Input | None]]:
        """End of the id, release angle (rad) and input of the runs of a spring and a speed, free decays first."""
        repeats = [f"-{number + 1}" if document.repeats > 1 else "" for number in range(document.repeats)]
        for angle in document.release_angles_deg:
            yield from ((f"a{_short(angle)}{repeat}", radians(angle), None) for repeat in repeats)
        for amplitude in () if table is None else table.amplitudes:
            for repeat in repeats:
                if amplitude is None or table is None:
                    yield f"file{repeat}", 0.0, given
                else:
                    drive = input_of_run(table, amplitude, next(numbers), time)
                    yield f"d{_short(amplitude)}{repeat}", 0.0, drive

    stated = document.truth.model_dump(exclude_none=True)
    own = {"yaw_inertia": rig.dynamics.yaw_inertia, "mechanical_damping": rig.dynamics.mechanical_damping}
    density = rig.air.density if document.air_density is None else document.air_density
    return CampaignPlan(
        name=document.name,
        description=document.description,
        seed=document.seed,
        truth=Truth(**(own | stated)),
        conditions=tuple(
            Condition(
                id=f"{label}-v{_short(speed)}-{start}",
                spring_stiffness=stiffness,
                wind_speed=speed,
                air_density=density,
                release_angle=angle,
                duration=document.duration,
                drive=drive,
                gain=1.0 if table is None or table.gain is None else table.gain,
            )
            for label, stiffness in springs
            for speed in document.wind_speeds
            for start, angle, drive in starts()
        ),
        sensor=SensorModel(**document.sensor.model_dump(exclude_none=True)),
        effects=tuple(EffectSetting(effect.name, dict(effect.parameters)) for effect in document.effects),
        scatter=document.scatter.value,
        repeatability=document.repeatability.value,
    )


def paper_plan() -> CampaignPlan:
    """The paper's campaign (``data/paper-campaign.toml``): four springs, wind off and at three speeds."""
    with resources.as_file(resources.files("tunnel_sim") / "data" / "paper-campaign.toml") as path:
        return load_plan(path)


def _short(value: float) -> str:
    """The shortest text that represents a number uniquely: ``15``, ``16.12``."""
    return repr(value + 0.0).removesuffix(".0")  # + 0.0 turns minus zero into zero


Formula = Annotated[OneLine, Field(max_length=limits.EXPRESSION_CHARACTERS)]


class ParameterTable(StrictModel):
    """``[effects.parameters.NAME]``."""

    unit: OneLine = Field(description='a unit in quotes, such as "N m/rad", or "1" for a number')
    scale: float = Field(description="a typical value, a number in its unit")
    lower: float = Field(description="the least value, a number in its unit")
    upper: float = Field(description="the greatest value, a number in its unit")
    default: float | None = optional("a number in its unit")
    meaning: OneLine | None = optional("a clause in quotes")


class OwnEffectTable(StrictModel):
    """``[[effects]]``."""

    name: Annotated[OneLine, Field(pattern="^[a-z][a-z0-9_]{0,63}$")] = Field(
        description="a name of lower-case letters, digits and _"
    )
    channel: Literal["stiffness", "damping", "forcing", "sensor", "calibration"] = Field(
        description="stiffness, damping, forcing, sensor or calibration"
    )
    condition: Literal["always", "wind_on"] = Field(default="always", description="always or wind_on")
    moment: Formula | None = optional("an expression in quotes, N m")
    reading: Formula | None = optional("an expression in quotes, rad")
    summary: OneLine = Field(default="An effect by expression.", description="a sentence in quotes")
    parameters: Annotated[
        dict[str, ParameterTable], Field(min_length=1, max_length=limits.OWN_PARAMETERS)
    ] = Field(description="tables [effects.parameters.NAME], the severity first")


class EffectsDocument(StrictModel):
    """The whole of an effects file."""

    motion: Motion | None = optional("'angle' or 'displacement'")
    effects: Annotated[list[OwnEffectTable], Field(min_length=1, max_length=limits.OWN_EFFECTS)] = Field(
        description="tables [[effects]]"
    )
