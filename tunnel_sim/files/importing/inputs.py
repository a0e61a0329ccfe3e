"""The input of a driven run: its column, found by name and unit, and by a test whether it drives the motion."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.column_names import ANGLE, named
from tunnel_sim.files.importing.condition_names import condition_of
from tunnel_sim.files.importing.remarks import doubt
from tunnel_sim.files.importing.tables import Channel, RunColumn, is_input
from tunnel_sim.vocabulary.errors import TunnelError, asking, counted, did_you_mean, one_line
from tunnel_sim.vocabulary.freedom import FREEDOMS, Freedom
from tunnel_sim.vocabulary.input_kinds import INPUTS, Command, InputColumn
from tunnel_sim.vocabulary.inputs import Input, checked_input
from tunnel_sim.vocabulary.quantities import PerSample, Rows, Share
from tunnel_sim.vocabulary.record import Record

_NAMES = re.compile(
    r"(?<![a-z])(torque|moment|drehmoment|drive|input|excitation|anregung|command|cmd|control|motor|shaker|actuator|"
    r"tau|effort|u|base|root)(?![a-z])",
    re.IGNORECASE,
)
_FALSE_ALARM = 1e-5  # probability that a column without effect on the motion is mistaken for its input
_ALIKE = 0.9  # correlation from which a column is the angle or its rate by another sensor
_PAST = 12  # number of earlier readings that predict a free motion so well that the noise is nearly white
_INPUTS = 4  # readings of an input, the present and earlier ones: inertia, damping, stiffness and a lag
# maximum number of means in a cycle for the test: with more, each hardly differs from its neighbours
_PER_CYCLE = 30
_SINGULAR = 1e-9  # share of the largest singular value: a smaller one is rounding
_LEAST_MEANS = 2000  # number of means of a record with as many samples, whatever its apparent cycle


def stated_input(channels: Sequence[Channel], choices: ImportChoices) -> Channel | None:
    """The column stated as the input, by name, with or without its unit, or by number; None: there is none."""
    found = [] if choices.input is None else named(channels, choices.input)
    return found[0] if found else None


def names_command(channel: Channel) -> bool:
    """Whether a column is the command of a servo, by its name and unit."""
    return any(_claimed(channel, freedom) == Command.column for freedom in FREEDOMS.values())


def names_input(channel: Channel, freedom: Freedom) -> bool:
    """Whether a column may be an input of a motion, by its name and unit, and is not a condition."""
    claimed = is_input(channel) or _claimed(channel, freedom) is not None
    plausible = claimed or _NAMES.search(channel.name) is not None
    # in the unit of the motion: beside a displacement, kN has been written as knots are
    return plausible and condition_of(channel.name, freedom.input_unit(channel.name, channel.unit)) is None


def find_input(
    channels: Sequence[Channel], clock: Channel, reading: RunColumn, choices: ImportChoices, where: str
) -> RunColumn | None:
    """The input of a run, in the unit of its kind; the kind is its role. None for a free decay.

    Args:
        clock: the column of times.
    """
    if choices.input == "none":
        return None
    others = [channel for channel in channels if channel is not clock and channel is not reading.channel]
    values = reading.values
    if choices.input is not None:
        stated = stated_input(channels, choices)
        if stated is not None and all(stated is not one for one in others):
            use = "times are" if stated is clock else "angle is"
            column = f"'{one_line(choices.input, 40)}' is the column {stated.quoted}"
            what = f"{column}, from which the {use} read"
            remedy = "give --input with the name or number of another column, or --angle with the angle's"
            raise TunnelError(what, where=where, remedy=remedy)
        if stated is None:
            what = f"no column '{one_line(choices.input, 40)}' for the input"
            remedy = f"--input: {did_you_mean(choices.input, {c.name for c in others})}"
            raise TunnelError(what, where=where, remedy=remedy)
        return _as_input(stated, reading, choices, where)
    # a column that is empty here is the input of other runs of the file
    exact = [channel for channel in others if is_input(channel) and np.isfinite(channel.values).any()]
    candidates = [*exact]
    for channel in () if exact else others:
        good = np.isfinite(channel.values) & np.isfinite(values)
        if not names_input(channel, FREEDOMS[reading.motion]) or np.count_nonzero(good) < 16:
            continue
        record = Record(np.arange(np.count_nonzero(good), dtype=np.float64), values[good])
        with suppress(TunnelError):  # it is not the motion itself
            checked_input(Input("drive", channel.values[good]), record, "", judged=False)
            # by its name, the command of an angle moves the body, however little of the motion it explains
            certain = names_command(channel) and ANGLE.search(channel.name)
            if certain or chance_without_effect(channel.values[good], values[good]) < _FALSE_ALARM:
                candidates.append(channel)
    commands = [channel for channel in candidates if names_command(channel)]
    beside: list[str] = []
    if len(commands) == 1 and not exact:
        beside = [
            doubt(
                f"{c.quoted} moves before or with the angle and is not used; --input uses it "
                f"instead of {commands[0].quoted}"
            )
            for c in candidates
            if c is not commands[0]
        ]
        candidates = commands
    if len(candidates) > 1:
        what = f"{len(candidates)} columns may be the input: {', '.join(c.quoted for c in candidates)}"
        option = f'--input "{one_line(candidates[0].name, 40)}"'
        raise asking(option, what, where, ", another of them, or --input none")
    return _as_input(candidates[0], reading, choices, where, beside) if candidates else None


def _as_input(
    channel: Channel, reading: RunColumn, choices: ImportChoices, where: str, beside: Sequence[str] = ()
) -> RunColumn:
    """A column as an input.

    Args:
        beside: remarks on other columns.
    """
    remarks, freedom = [*beside], FREEDOMS[reading.motion]
    stated = None if choices.input_as is None else freedom.stated_input(choices.input_as, "--input-as")
    column = stated or _claimed(channel, freedom) or "drive"
    kind, unit = INPUTS[column], freedom.input_unit(channel.name, channel.unit)
    factor, name = freedom.input_factor(kind, unit), one_line(channel.name, 40)
    if kind.of_spring and unit in ("", "counts"):
        if choices.calibration is not None or (unit and choices.counts_per_turn is None):
            what = f"'{name}' has no unit of an angle, and the reading's unit is not its own"
            remedy = (
                f"give the unit in its name, such as {name}_deg; or --input-as drive, whose gain is fitted"
            )
            raise TunnelError(what, where=where, remedy=remedy)
        factor = freedom.input_factor(kind, reading.unit) / (choices.counts_per_turn or 1.0)
        if choices.input_as is None:
            remarks.append(f"'{name}' is taken in the unit of the angle, {reading.unit}")
    size, lag = correlation(channel.values, reading.values)
    driven, free = f"driven by '{name}', {kind.meaning} ({column})", "--input none if it is a free decay"
    correlated = f"its correlation with the reading is {size:.2f} at a lag of {counted(lag, 'sample')}"
    remarks.append(doubt(f"{driven}: {correlated}; {free}", f"{driven}; {free}"))
    return RunColumn(channel, channel.values * factor, channel.unit, column, tuple(remarks))


def _claimed(channel: Channel, freedom: Freedom) -> InputColumn | None:
    """The kind of input of a motion shown by name and unit of a column; None if they do not show it."""
    kind = freedom.input_kind(channel.name, freedom.input_unit(channel.name, channel.unit))
    return None if kind is None else kind.column


def moves_before(values: PerSample, reading: PerSample) -> bool:
    """Whether a column predicts the reading like an input, without being its rate or proportional to it."""
    slope = np.gradient(reading)
    for own in (reading, slope):
        x, y = values - values.mean(), own - own.mean()
        scale = float(np.sqrt((x @ x) * (y @ y)))
        if scale > 0.0 and abs(float(x @ y)) > _ALIKE * scale:
            return False
    return chance_without_effect(values, reading) < _FALSE_ALARM


def chance_without_effect(values: PerSample, reading: PerSample) -> Share:
    """The chance that an input without effect predicts the motion as well, in addition to the motion's own past.

    An F test of two fits: each reading by the previous readings, as in a free motion; and by the input, too.
    """
    from scipy.special import fdtrc  # imported here because it is slow to load

    cycles = 1 + int(np.argmax(np.abs(np.fft.rfft(reading - reading.mean())[1:])))
    block = max(1, reading.size // max(_PER_CYCLE * cycles, _LEAST_MEANS))
    count = reading.size // block - _PAST
    free = count - 1 - _PAST - _INPUTS  # degrees of freedom
    if free < _PAST:
        return 1.0
    means = (x[: (count + _PAST) * block].reshape(-1, block).mean(axis=1) for x in (values, reading))
    u, y = (x / (np.abs(x).max() or 1.0) for x in (x - x.mean() for x in means))
    past = [y[_PAST - lag :][:count] for lag in range(1, _PAST + 1)]
    own, _ = np.linalg.qr(np.stack([np.ones(count), *past], axis=1))
    given = np.stack([u[_PAST - lag :][:count] for lag in range(_INPUTS)], axis=1)
    residual, beside = y[_PAST:] - own @ (own.T @ y[_PAST:]), given - own @ (own.T @ given)
    forms, sizes, _ = np.linalg.svd(beside, full_matrices=False)
    explained = (forms[:, sizes > _SINGULAR * max(sizes[0], _SINGULAR)].T @ residual) ** 2
    unexplained = float(residual @ residual - explained.sum())
    if not explained.size or not unexplained > 0.0:
        return 1.0
    return float(fdtrc(explained.size, free, explained.mean() * free / unexplained))


def correlation(values: Rows, reading: Rows) -> tuple[Share, int]:
    """The greatest correlation of an input with a later reading, and its lag, at most a quarter of the samples."""
    good = np.isfinite(values) & np.isfinite(reading)
    x, y = values[good] - values[good].mean(), reading[good] - reading[good].mean()
    scale = float(np.sqrt((x @ x) * (y @ y)))
    if not scale > 0.0:
        return 0.0, 0
    size = 2 * x.size
    lags = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)[: max(1, x.size // 4)]
    best = int(np.argmax(np.abs(lags)))
    return float(min(1.0, abs(lags[best]) / scale)), best
