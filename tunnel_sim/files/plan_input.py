"""``[drive]`` of a plan: the kind of drive, and the input of each driven run."""

from __future__ import annotations

from math import pi
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from tunnel_sim.files.run_files import read_input
from tunnel_sim.files.toml_input import OneLine, Positive, StrictModel, optional
from tunnel_sim.vocabulary.errors import TunnelError, one_of
from tunnel_sim.vocabulary.input_kinds import INPUTS, KINDS, InputColumn
from tunnel_sim.vocabulary.inputs import Hold, Input
from tunnel_sim.vocabulary.plan import band_noise, chirp, lines_in_band, multisine, square, stepped_sine
from tunnel_sim.vocabulary.quantities import Times

Kind = Literal["sine", "stepped_sine", "chirp", "multisine", "random", "square", "file"]

_COLUMNS = one_of([kind.column for kind in KINDS if kind.amplitudes])

_NEEDS: dict[Kind, tuple[str, ...]] = {
    "sine": ("frequency_hz",),
    "stepped_sine": ("frequencies_hz",),
    "chirp": ("from_hz", "to_hz"),
    "multisine": ("from_hz", "to_hz"),
    "random": ("from_hz", "to_hz"),
    "square": ("frequency_hz",),
    "file": ("file",),
}
_BANDS = ("multisine", "random")  # kinds with lines in a band, with phases that may be drawn
_OF_AMPLITUDES = {kind.amplitudes: kind for kind in KINDS if kind.amplitudes}
_OF_GAIN = tuple(kind for kind in _OF_AMPLITUDES.values() if kind.takes_gain)
_OPTIONAL = ("frequency_hz", "frequencies_hz", "from_hz", "to_hz", "file", "seed", "gain", *_OF_AMPLITUDES)


class InputTable(StrictModel):
    """``[drive]``."""

    kind: Kind = Field(
        description="'sine', 'stepped_sine', 'chirp', 'multisine', 'random', 'square' or 'file'"
    )
    amplitudes_nm: list[Positive] = Field(
        default=[], description="a list of peak moments on the body in N m, such as [0.05, 0.2]"
    )
    amplitudes_rad: list[Annotated[float, Field(gt=0.0, le=pi)]] = Field(
        default=[], description="a list of peak angles of the spring's root in rad, such as [0.02, 0.05]"
    )
    amplitudes_rad_s2: list[Positive] = Field(
        default=[], description="a list of peak angular accelerations of the base in rad/s2, such as [2, 5]"
    )
    amplitudes_m_s2: list[Positive] = Field(
        default=[], description="a list of peak accelerations of the base in m/s2, such as [0.5, 2]"
    )
    gain: Annotated[float, Field(allow_inf_nan=False)] | None = Field(
        default=None,
        description="mass times arm of a base that is accelerated, a number other than 0 in kg m",
    )
    hold: Hold = Field(default="linear", description="'zero' or 'linear', between the samples")
    frequency_hz: Positive | None = optional("a positive number in Hz")
    frequencies_hz: list[Positive] = Field(default=[], description="a list of positive numbers in Hz")
    from_hz: Positive | None = optional("a positive number in Hz")
    to_hz: Positive | None = optional("a positive number in Hz")
    seed: int | None = Field(default=None, ge=0, description="a whole number, zero or more")
    file: OneLine | None = optional(f"a CSV or Parquet file with time_s, and {_COLUMNS}")

    @property
    def amplitudes(self) -> tuple[float | None, ...]:
        """Peak of each driven run of a spring and a speed, in the unit of the input; a single None for a file."""
        if self.kind == "file":
            return (None,)
        return tuple(value for name in _OF_AMPLITUDES for value in getattr(self, name))

    @property
    def column(self) -> InputColumn:
        """The column of the input, unless a file gives it."""
        return next(kind.column for name, kind in _OF_AMPLITUDES.items() if getattr(self, name))


def check_input_table(table: InputTable, samples: int, sample_rate: float, where: str) -> None:
    """Refuse a drive with a missing key, with a key that its kind does not take, or too fast for the samples.

    Args:
        samples: number of samples of a run.
        sample_rate: sample rate, Hz.
    """
    given = [name for name in _OPTIONAL if getattr(table, name) not in (None, [])]
    needed = _NEEDS[table.kind]
    for name in needed:
        if name not in given:
            remedy = f"give {name} as {InputTable.model_fields[name].description}"
            raise TunnelError(f"kind = '{table.kind}' needs {name}", where=where, remedy=remedy)
    taken = (
        *needed,
        *(("seed",) if table.kind in _BANDS else ()),
        *(_OF_AMPLITUDES if table.kind != "file" else ()),
        "gain",
    )
    for name in given:
        if name not in taken:
            remedy = "leave it out"
            raise TunnelError(f"kind = '{table.kind}' does not take {name}", where=where, remedy=remedy)
    amplitudes = [name for name in given if name in _OF_AMPLITUDES]
    if table.kind != "file" and len(amplitudes) != 1:
        what = f"both {' and '.join(amplitudes)}" if amplitudes else "no amplitudes"
        listed = [f"{name} ({kind.meaning})" for name, kind in _OF_AMPLITUDES.items()]
        raise TunnelError(what, where=where, remedy=f"give {one_of(listed)}")
    if table.kind != "file":
        _check_gain(table.gain, table.column, where)
    if len(set(table.amplitudes)) < len(table.amplitudes):
        remedy = "leave one out, and use repeats for more runs"
        raise TunnelError("the amplitudes hold a value twice", where=where, remedy=remedy)
    for name in ("frequency_hz", "from_hz", "to_hz"):
        _check_sampled(name, getattr(table, name), sample_rate, where)
    for frequency in table.frequencies_hz:
        _check_sampled("frequencies_hz", frequency, sample_rate, where)
    low, high = table.from_hz, table.to_hz
    if table.kind not in _BANDS or low is None or high is None:
        return
    if low > high or not lines_in_band(samples, 1.0 / sample_rate, low, high).size:
        raise TunnelError(
            f"no multiple of {sample_rate / samples:.4g} Hz, one over the duration, lies between from_hz = {low:g} "
            f"and to_hz = {high:g}",
            where=where,
            remedy="widen the band, or give a longer duration",
        )


def _check_gain(gain: float | None, column: InputColumn, where: str) -> None:
    """Refuse an input that lacks a required gain, or has one that it does not take."""
    needs = INPUTS[column] in _OF_GAIN
    if needs != bool(gain):
        what = f"the input {column} needs a gain" if needs else f"the input {column} does not take a gain"
        remedy = "give gain as mass times arm, a number other than 0 in kg m" if needs else "leave it out"
        raise TunnelError(what, where=where, remedy=remedy)


def _check_sampled(name: str, frequency: float | None, sample_rate: float, where: str) -> None:
    if frequency is not None and not frequency < 0.5 * sample_rate:
        what = f"{name} = {frequency:g} is not below half the sample rate of {sample_rate:g} Hz"
        raise TunnelError(what, where=where, remedy="lower it, or raise sample_rate under [sensor]")


def input_of_run(table: InputTable, amplitude: float, number: int, time_s: Times) -> Input:
    """The input of one driven run, unless a file gives it.

    Args:
        amplitude: peak, in the unit of the input.
        number: number of the driven run in the plan, from 0 on: drawn phases differ from run to run.
    """
    low, high = table.from_hz or 0.0, table.to_hz or 0.0
    rng = np.random.default_rng([table.seed or 0, number])
    match table.kind:
        case "square":
            wave = square(time_s, table.frequency_hz or 0.0)
        case "chirp":
            wave = chirp(time_s, low, high)
        case "multisine":
            wave = multisine(time_s, low, high, None if table.seed is None else rng)
        case "random":
            wave = band_noise(time_s, low, high, rng)
        case _:
            wave = stepped_sine(time_s, table.frequencies_hz or [table.frequency_hz or 0.0])
    return Input(table.column, amplitude * wave, table.hold)


def input_of_file(path: Path, time_s: Times, table: InputTable, where: str) -> Input:
    """The input of a file at the times of the samples from 0 on; time 0 is its first value."""
    given, column, values = read_input(path, where)
    hold = table.hold
    if not INPUTS[column].amplitudes:
        what = "no known unit" if column == "drive" else "no meaning in a plan, since it needs a servo"
        raise TunnelError(f"the column {column} has {what}", where=where, remedy=f"name it {_COLUMNS}")
    _check_gain(table.gain, column, where)
    given = given - given[0]
    slack = 1e-6 * (time_s[1] - time_s[0])
    if given[-1] < time_s[-1] - slack:
        what = f"ends after {given[-1]:.6g} s, before the last sample of a run at {time_s[-1]:.6g} s"
        raise TunnelError(what, where=where, remedy="give a longer file or a shorter duration")
    if hold == "zero":
        sampled = values[np.searchsorted(given, time_s + slack, side="right") - 1]
    else:
        sampled = np.interp(time_s, given, values)
    if np.ptp(sampled) == 0.0:
        remedy = "give an input that changes"
        raise TunnelError(f"the column {column} is constant", where=where, remedy=remedy)
    return Input(column, sampled, hold)
