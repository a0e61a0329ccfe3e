"""The grid of conditions for scoring estimators, a TOML file; its cells, and their simulated records.

The motion comes from the compiled forward integrator, the reading from the virtual potentiometer. A trial
depends only on the seed, its cell and its number. Therefore every estimator gets the same records, and a cell
has the same records in any grid.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from itertools import product
from pathlib import Path
from typing import Annotated, Any, Literal
from zlib import crc32

import numpy as np
from pydantic import Field, TypeAdapter

from identification.estimate import PARAMETERS
from identification.estimators import free_decay_estimators
from tunnel_lab.experiments.bounds import coefficients_bound, decay_bound, in_phase
from tunnel_lab.terminal.arguments import NO_EFFECT, parse_effect
from tunnel_sim.effects import BetweenRuns, Effect, EffectChain, effect_from, known_effects
from tunnel_sim.effects.chain import read_motion
from tunnel_sim.files.plan_file import check_size, first_twice
from tunnel_sim.files.reading import as_described, check_count, check_shape
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.files.toml_input import OneLine, Positive, SampleRate, StrictModel, read_document, shown
from tunnel_sim.physics.forward import forward_motion
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.physics.steps import follow_fastest, whole_steps
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.between_runs import Repeatability
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean
from tunnel_sim.vocabulary.plan import AeroDerivatives, SensorModel, Truth
from tunnel_sim.vocabulary.rig import Rig

DECAY_QUANTITIES = ("zeta", "omega_n")

_LEAST_TRIALS = 2
_ZETA_SPREAD, _FREQUENCY_SPREAD, _RELEASE_SPREAD = 0.05, 0.02, 0.03
_ZERO_STD = 0.004  # rad


class _RecordsTable(StrictModel):
    """Keys of all tables."""

    noise: list[Positive] = Field(
        min_length=1, description="a list of noise levels over the amplitude, such as [0.001, 0.01]"
    )
    duration: list[Positive] = Field(min_length=1, description="a list of record lengths in s, such as [20]")
    amplitude: Positive = Field(default=0.35, description="the release angle, a positive number in rad")
    sample_rate: SampleRate = Field(default=1000.0, description="a positive number in Hz")
    resolution: Annotated[float, Field(ge=0.0)] = Field(
        default=0.0, description="a number in rad, zero for none"
    )


class DecaysTable(_RecordsTable):
    """``[[decays]]``: single free decays with the wind off; every combination is a cell."""

    zeta: list[Annotated[float, Field(gt=0.0, lt=1.0)]] = Field(
        min_length=1, description="a list of damping ratios between 0 and 1, such as [0.002, 0.05]"
    )
    frequency: list[Positive] = Field(
        min_length=1, description="a list of natural frequencies in Hz, such as [0.8, 4.0]"
    )


class CampaignsTable(_RecordsTable):
    """``[[campaigns]]``: every spring with the wind off and at one speed; each speed, noise, … makes a cell."""

    springs: list[Positive] = Field(min_length=1, description="a list of stiffnesses in N m/rad")
    wind_speeds: list[Positive] = Field(min_length=1, description="a list of speeds in m/s, such as [10, 25]")
    effects: list[OneLine] = Field(
        default=[NO_EFFECT],
        min_length=1,
        description='a list such as ["none", "coulomb_friction:friction_moment=0.004"], effects that act at once '
        "joined by ' + '",
    )


class GridDocument(StrictModel):
    """The whole of a grid."""

    schema_version: int = Field(description="1")
    name: OneLine = Field(description="a short name in quotes")
    seed: int = Field(ge=0, description="a whole number, zero or more")
    trials: int = Field(ge=2, le=100_000, description="the records in each cell, a whole number from 2")
    trials_of: dict[str, Annotated[int, Field(ge=2)]] = Field(
        default={}, description="a table of estimators that see fewer records, such as { bayesian = 20 }"
    )
    decays: list[DecaysTable] = Field(default=[], description="[[decays]] tables")
    campaigns: list[CampaignsTable] = Field(default=[], description="[[campaigns]] tables")


@dataclass(frozen=True)
class Cell:
    """One point of the grid.

    Args:
        kind: ``decay`` (one wind-off run with given ζ and frequency) or ``campaign``.
        noise: standard deviation of the sensor's noise over the amplitude, a ratio.
        duration: duration of every record, s.
        amplitude: amplitude of the release, rad.
        sample_rate: sample rate, Hz.
        resolution: resolution of the sensor, rad; 0 for none.
        zeta: damping ratio of a decay; 0 in a campaign.
        frequency: natural frequency of a decay, Hz; 0 in a campaign.
        wind_speed: wind speed of a campaign's wind-on runs, m/s; 0 in a decay.
        springs: springs of a campaign, N m/rad; none in a decay.
        effect: effect in the format of ``tunnel simulate --effect``, several joined by `` + ``; ``none``:
            nominal model.
    """

    kind: Literal["decay", "campaign"]
    noise: float
    duration: float
    amplitude: float
    sample_rate: float
    resolution: float
    zeta: float = 0.0
    frequency: float = 0.0
    wind_speed: float = 0.0
    springs: tuple[float, ...] = ()
    effect: str = NO_EFFECT

    @property
    def label(self) -> str:
        """The cell in one line; different cells have different lines."""
        tail = f"S/A {100 * self.noise:g} %, {self.duration:g} s"
        if (self.amplitude, self.sample_rate, self.resolution) != (0.35, 1000.0, 0.0):
            tail += f", A {self.amplitude:g} rad, {self.sample_rate:g} Hz"
            tail += f", step {self.resolution:g} rad" if self.resolution else ""
        if self.kind == "decay":
            return f"ζ {self.zeta:g}, {self.frequency:g} Hz, {tail}"
        springs = "/".join(f"{spring:g}" for spring in self.springs)
        effect = "" if self.effect == NO_EFFECT else f", {self.effect}"
        return f"Kr {springs} N m/rad, V {self.wind_speed:g} m/s, {tail}{effect}"

    @property
    def quantities(self) -> tuple[str, ...]:
        """Names of the scored quantities in an estimate's JSON."""
        return DECAY_QUANTITIES if self.kind == "decay" else PARAMETERS

    @property
    def runs(self) -> int:
        """Number of records in one trial."""
        return 1 if self.kind == "decay" else 2 * len(self.springs)


@dataclass(frozen=True)
class Grid:
    """The conditions of a score: at least one cell, all different, and the number of trials in each."""

    name: str
    seed: int
    trials: int
    trials_of: tuple[tuple[str, int], ...]
    cells: tuple[Cell, ...]

    def trials_for(self, estimator: str) -> int:
        """Number of trials for an estimator in each cell, always the first trials."""
        return min(self.trials, dict(self.trials_of).get(estimator, self.trials))

    def to_json_dict(self) -> dict[str, Any]:
        """The data that determine the records, in JSON's types."""
        return {
            "name": self.name,
            "seed": self.seed,
            "trials": self.trials,
            "trials_of": dict(self.trials_of),
            "cells": [dict(vars(cell)) | {"springs": list(cell.springs)} for cell in self.cells],
        }

    @classmethod
    def from_json_dict(cls, data: dict[str, Any]) -> Grid:
        """The inverse of `to_json_dict`; a `TunnelError` when the data are not a grid, or are too large."""
        where, remedy = "the grid as JSON", "write it again"
        check_shape(data, where, remedy)
        with as_described("is not a grid", where, remedy):
            grid: Grid = _GRID.validate_python(data | {"trials_of": tuple(data["trials_of"].items())})
            possible = bool(grid.cells) and grid.trials >= _LEAST_TRIALS
            for cell in grid.cells:
                positive = (cell.noise, cell.duration, cell.amplitude, cell.sample_rate, *cell.springs)
                possible &= min(positive) > 0.0 and min(cell.resolution, cell.wind_speed) >= 0.0
                possible &= 0.0 <= cell.zeta < 1.0
            if not possible:
                raise ValueError("a cell or a number of trials is out of range")
        check_count(len(grid.cells), limits.SCORE_CELLS, "cells", where, "shorten a list")
        for cell in grid.cells:
            check_size(cell.runs, cell.duration, cell.sample_rate, where)
        return grid


_GRID = TypeAdapter(Grid)


def load_grid(path: Path) -> Grid:
    """Read a grid, a TOML file like the packaged ``score-grid.toml``.

    Returns:
        The grid; cells in the order of the tables, the last list of a table varies fastest.
    """
    missing = "name a grid such as the packaged score-grid.toml, or leave it out"
    document = read_document(GridDocument, path, missing=missing)
    where = shown(path)
    for text in dict.fromkeys(text for table in document.campaigns for text in table.effects):
        _check_effects(text, where)
    count = 0  # from the lengths of the lists, before any cell is made
    for decay in document.decays:
        count += len(decay.zeta) * len(decay.frequency) * len(decay.noise) * len(decay.duration)
        check_size(1, max(decay.duration), decay.sample_rate, f"{where}, decays")
    for table in document.campaigns:
        count += len(table.wind_speeds) * len(table.noise) * len(table.duration) * len(table.effects)
        check_size(2 * len(table.springs), max(table.duration), table.sample_rate, f"{where}, campaigns")
    check_count(count, limits.SCORE_CELLS, "cells", where, "shorten a list")
    cells = []
    for decay in document.decays:
        sensor = (decay.amplitude, decay.sample_rate, decay.resolution)
        for zeta, hertz, noise, duration in product(decay.zeta, decay.frequency, decay.noise, decay.duration):
            cells.append(Cell("decay", noise, duration, *sensor, zeta=zeta, frequency=hertz))
    for table in document.campaigns:
        sensor, springs = (table.amplitude, table.sample_rate, table.resolution), tuple(table.springs)
        for speed, noise, duration, effect in product(
            table.wind_speeds, table.noise, table.duration, table.effects
        ):
            cell = Cell(
                "campaign", noise, duration, *sensor, wind_speed=speed, springs=springs, effect=effect
            )
            cells.append(cell)
    if not cells:
        raise TunnelError("no cells", where=where, remedy="add a [[decays]] or [[campaigns]] table")
    twice = first_twice(cells)
    if twice is not None:
        raise TunnelError(f"the cell {twice.label!r} occurs twice", where=where, remedy="remove one")
    for name in document.trials_of:
        if name not in free_decay_estimators():
            remedy = did_you_mean(name, free_decay_estimators())
            raise TunnelError(f"no estimator {name!r}", where=f"{where}, [trials_of]", remedy=remedy)
    trials_of = tuple(document.trials_of.items())
    return Grid(document.name, document.seed, document.trials, trials_of, tuple(cells))


def _check_effects(text: str, where: str) -> None:
    """Refuse an entry of ``effects`` that is malformed, does nothing, or names an effect twice."""
    try:
        acting = effects_of(text)
    except TunnelError as error:
        raise TunnelError(error.what, where=f"{where}, effect {text!r}", remedy=error.remedy) from error
    if any(effect.is_null for effect in acting):
        remedy = f'give its severity, or write "{NO_EFFECT}"'
        raise TunnelError(f"effect {text!r} does nothing", where=where, remedy=remedy)
    twice = first_twice([effect.name for effect in acting])
    if twice is not None:
        raise TunnelError(f"{twice} is given twice", where=f"{where}, effect {text!r}", remedy="give it once")


def packaged_grid() -> Grid:
    """The default grid."""
    with resources.as_file(resources.files("tunnel_lab") / "data" / "score-grid.toml") as path:
        return load_grid(path)


@dataclass(frozen=True, eq=False)
class ScoreTrial:
    """A campaign of known truth.

    Args:
        truth: true values by quantity, SI; ζ and ωn for the first run. With a lag of the air, Cnβ and Cnr are in
            phase with angle and rate.
        bound: Cramér–Rao bound of the nominal model by quantity, SI, including any scatter between the runs;
            quantities without one are left out.
    """

    campaign: Campaign
    truth: Mapping[str, float]
    bound: Mapping[str, float]


def draw_trial(cell: Cell, seed: int, number: int) -> ScoreTrial:
    """Make one trial of a cell, without stated noise; trials are numbered from 0.

    Results are bit-identical for equal arguments.

    Raises:
        TunnelError: when a run leaves the finite range.
    """
    rng = np.random.default_rng([seed, crc32(cell.label.encode()), number])
    rig = load_rig()
    noise = float(np.hypot(cell.noise * cell.amplitude, cell.resolution / np.sqrt(12.0)))
    if cell.kind == "campaign":
        truth = Truth(
            cn_beta=rng.uniform(0.25, 0.57),
            cn_r=-rng.uniform(0.06, 0.24),
            yaw_inertia=rng.uniform(0.098, 0.110),
            mechanical_damping=rng.uniform(0.007, 0.020),
        )
        runs = [
            (spring, speed, cell.amplitude * (1.0 + _RELEASE_SPREAD * rng.standard_normal()))
            for spring in cell.springs
            for speed in (0.0, cell.wind_speed)
        ]
        campaign = _campaign(cell, truth, runs, rig, rng)
        scatter = Repeatability(
            **{one.scatters: one.severity for one in effects_of(cell.effect) if isinstance(one, BetweenRuns)}
        )
        density = rig.air.density
        truth = in_phase(truth, effects_of(cell.effect), [(k, v, density) for k, v, _ in runs], rig)
        bound = coefficients_bound(campaign, truth, [release for *_, release in runs], noise, scatter)
        return ScoreTrial(campaign, dict(vars(truth)), bound)
    zeta = cell.zeta * (1.0 + _ZETA_SPREAD * rng.uniform(-1.0, 1.0))
    omega = 2.0 * np.pi * cell.frequency * (1.0 + _FREQUENCY_SPREAD * rng.uniform(-1.0, 1.0))
    inertia = rig.dynamics.yaw_inertia
    truth = Truth(0.0, 0.0, inertia, 2.0 * zeta * omega * inertia)
    campaign = _campaign(cell, truth, [(inertia * omega**2, 0.0, cell.amplitude)], rig, rng)
    bound = decay_bound(campaign.runs[0].record.time_s, cell.amplitude, float(omega), float(zeta), noise)
    return ScoreTrial(campaign, {"zeta": zeta, "omega_n": omega}, bound)


def effects_of(text: str) -> tuple[Effect, ...]:
    """The effects of a cell, in the order of the vocabulary; none for ``none``.

    Args:
        text: text in the format of `Cell`.

    Raises:
        TunnelError: when a name is unknown or a value out of range.
    """
    given = () if text == NO_EFFECT else map(parse_effect, text.split(" + "))
    effects = [effect_from(setting.name, setting.parameters) for setting in given]
    known = known_effects()
    return tuple(sorted(effects, key=lambda effect: known.index(type(effect))))


def _campaign(
    cell: Cell,
    truth: Truth,
    conditions: Sequence[tuple[float, float, float]],
    rig: Rig,
    rng: np.random.Generator,
) -> Campaign:
    """Runs of (spring, speed, release). A decay does not state its spring, which gives normalised form."""
    effects = effects_of(cell.effect)
    sensor = SensorModel(
        cell.sample_rate, cell.noise * cell.amplitude, cell.resolution, _ZERO_STD * rng.standard_normal()
    )
    runs = []
    for number, (spring, speed, release) in enumerate(conditions, 1):
        settings = RunSettings(
            spring_stiffness=spring,
            derivatives=AeroDerivatives(truth.cn_beta, truth.cn_r),
            yaw_inertia=truth.yaw_inertia,
            mechanical_damping=truth.mechanical_damping,
            wind_speed=speed,
            air_density=rig.air.density,
            release_angle=release,
            duration=cell.duration,
            timestep=whole_steps(cell.sample_rate),
        )
        chain = EffectChain.draw(settings, effects, rng)
        try:
            motion = forward_motion(rig, follow_fastest(rig, chain.physics()), cell.sample_rate)
        except ValueError as error:
            remedy = "choose a stiffer spring or less wind"
            raise TunnelError(str(error), where=cell.label, remedy=remedy) from error
        runs.append(
            Run(
                id=f"r{number:02d}",
                record=read_motion(motion, sensor, rng, chain),
                wind_speed=speed,
                spring_stiffness=spring if cell.kind == "campaign" else None,
                air_density=rig.air.density if speed > 0.0 else None,
                release_angle=cell.amplitude,
            )
        )
    stated_sensor = SensorProperties(cell.sample_rate, cell.resolution or None)
    return Campaign("trial", RigProperties.of(rig), stated_sensor, tuple(runs))
