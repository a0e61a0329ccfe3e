"""Step 3 of an import: find the conditions of runs, stated in numbers, columns and names, and by the user."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tunnel_sim.files.importing.choices import ImportChoices
from tunnel_sim.files.importing.column_numbers import describes_samples
from tunnel_sim.files.importing.condition_names import (
    OF_CAMPAIGN,
    RUN_KEYS,
    SPEED_IN_TEXT,
    WIND_ON,
    Conditions,
    Hint,
    condition_of,
    in_si,
    in_unknown_unit,
    resembles,
    units_of,
)
from tunnel_sim.files.importing.import_statements import ImportStatements
from tunnel_sim.files.importing.remarks import ImportRemark, doubt
from tunnel_sim.files.importing.tables import INPUT_FACTS, Channel, Table
from tunnel_sim.files.importing.units import claims, known_unit, split_unit
from tunnel_sim.files.plausible import plausible_values
from tunnel_sim.files.toml_input import validate
from tunnel_sim.vocabulary.campaign import needs_density
from tunnel_sim.vocabulary.errors import TunnelError, asking, counted, did_you_mean, one_line
from tunnel_sim.vocabulary.freedom import ANGLE, Freedom

_OFF = 0.5  # share of the range: the median of a wind speed that starts late is further from zero
_EVEN = 1e-9  # share of a value: a column that varies less is constant
_ALIKE = 1e-6  # share of a value: two statements that differ by less agree, such as 10 m/s and 36 km/h
_IN_TABLE = ("wind_speed", "spring_stiffness")  # columns of the table of runs
_LISTED = 10  # number of statements of a file that a remark lists


class Unstated(TunnelError):
    """A condition of a run that only the user can state, even if there are other sources."""


@dataclass(frozen=True, eq=False)
class Stated:
    """The statements of a table.

    Args:
        numbers: conditions and sizes by key of `Conditions`, in its units.
        columns: columns of conditions by key.
        named: conditions in the name of the file, by key.
        hints: hints of unused numbers of the file.
        like: unused columns that resemble conditions, with their hints.
    """

    numbers: Mapping[str, float]
    columns: Mapping[str, Channel]
    named: Mapping[str, float] = field(default_factory=dict)
    hints: tuple[Hint, ...] = ()
    like: tuple[tuple[Channel, Hint], ...] = ()

    def measured(self, rows: NDArray[np.intp]) -> tuple[dict[str, float], list[str]]:
        """Conditions stated by columns in some rows, and remarks on them."""
        stated = {
            key: (value, remark)
            for key, column in self.columns.items()
            for value, remark in _from_column(key, column, rows, in_si(key, column.unit) or 1.0)
        }
        remarks = [remark for _, remark in stated.values() if remark]
        names = [(key, self.columns[key].name) for key in stated]
        if names:
            listed = ", ".join(
                key if key == name else f"{key} ('{one_line(name, 40)}')" for key, name in names
            )
            remarks.append(f"from columns: {listed}")
        return {key: value for key, (value, _) in stated.items()}, remarks

    def unused(self, rows: NDArray[np.intp]) -> list[Hint]:
        """Unused content that resembles a condition in some rows, except columns about zero."""
        found = [*self.hints]
        for column, hint in self.like:
            values = _from_column(hint.key, column, rows, 1.0)
            found += [replace(hint, value=value) for value, _ in values if np.isfinite(value)]
        return found


def find_conditions(
    table: Table, used: Sequence[Channel], choices: ImportChoices, where: str, freedom: Freedom = ANGLE
) -> tuple[Stated, list[str]]:
    """The statements of a table about the conditions of its runs, and remarks on them.

    Args:
        used: the columns with other uses.
        freedom: freedom of the readings; conditions are stated under its names and in its units.
    """
    claimed = choices.stated_by.model_dump(exclude_none=True)
    numbers, hints, remarks = _from_facts(table, claimed, where, freedom)
    columns: dict[str, Channel] = {}
    like = []
    for channel in table.channels:
        if any(channel is one for one in used):
            continue
        key = next((key for key, text in claimed.items() if claims(text, channel.name, channel.unit)), None)
        name, unit, factor = freedom.condition(channel.name, channel.unit)
        if unit != channel.unit:
            channel = replace(channel, unit=unit, values=factor * channel.values)
        key = key or condition_of(name, unit)
        if (key or resembles(name, unit)) in freedom.refused:
            continue
        if key is not None and in_si(key, unit) is not None:
            columns.setdefault(key, channel)  # the first of several with the same statement
        elif hint := _hint(name, unit, key, float("nan")):
            like.append((channel, hint))
    known = {**table.facts, **{channel.name: 0.0 for channel in table.channels}}
    for key, text in claimed.items():
        if key not in numbers and key not in columns:
            what = f"no column or number '{one_line(text, 40)}' that states {key}"
            raise TunnelError(what, where=where, remedy=f"--set {key}: {did_you_mean(text, known)}")
    hints += [hint for name, text in table.texts.items() if (hint := _hint_of_text(name, text)) is not None]
    return Stated(numbers, columns, hints=tuple(hints), like=tuple(like)), remarks


def _hint_of_text(name: str, text: str) -> Hint | None:
    """The hint of a text that mentions a speed, or that the wind is on."""
    shown_text = f"'{one_line(name, 40)}: {one_line(text, 60)}'"
    speed = SPEED_IN_TEXT.search(text)
    if speed is not None:
        unit = known_unit(speed[2]) or ""
        value = float(speed[1].replace(",", ".")) * (in_si("wind_speed", unit) or 1.0)
        option = f"--set wind_speed={value:g}"
        why = "it is a text that mentions a speed"
        return Hint("wind_speed", value, shown_text, why, f"{option} uses it", option=option)
    if WIND_ON.search(text):
        use = "--set wind_speed=SPEED (m/s) states it"
        return Hint("wind_speed", float("nan"), shown_text, "it is a text that mentions a wind", use)
    return None


def _from_facts(
    table: Table, claimed: Mapping[str, str], where: str, freedom: Freedom
) -> tuple[dict[str, float], list[Hint], list[str]]:
    """Conditions and sizes stated by the numbers of a table, by key, in the units of `Conditions`; hints; remarks.

    The last remark lists the numbers and texts that are neither used nor hints.

    Args:
        claimed: by key, the names of numbers that, according to the user, state a condition.
    """
    conditions: dict[str, float] = {}
    names: dict[str, str] = {}
    contested: dict[str, Hint] = {}
    hints = []
    unused = []
    for heading, value in table.facts.items():
        name, unit = split_unit(heading)
        key = next((key for key, text in claimed.items() if claims(text, name, unit)), None)
        sure = key is not None
        name, unit, own = freedom.condition(name, unit)
        key, value = key or condition_of(name, unit, alone=True), own * value
        if (key or resembles(name, unit)) in freedom.refused:
            continue
        if key is not None and not np.isfinite(value):
            hints.append(_hint_of_several(name, key))
        elif key is not None and (factor := in_si(key, unit)) is not None:
            number = float(value) * factor
            if sure or names.get(key) not in claimed.values():
                if not sure and abs(conditions.get(key, number) - number) > _ALIKE * abs(number):
                    contested[key] = _hint_of_several(f"{names[key]}', '{name}", key)
                conditions[key], names[key] = number, name
        elif sure:
            what = f"'{one_line(heading, 60)}' is not in a unit of {key} ({units_of(key or '')})"
            raise asking(f"--set {key}=NUMBER", what, where)
        elif hint := _hint(name, unit, key, float(value)):
            hints.append(hint)
        elif heading not in INPUT_FACTS and not describes_samples(heading):
            stated = f"{value:g}" if np.isfinite(value) else "several numbers"
            unused.append(f"{one_line(heading, 40)} = {stated}")
    for key in [key for key in contested if names[key] not in claimed.values()]:
        hints.append(contested[key])
        del conditions[key], names[key]
    symbols = [hint for hint in hints if hint.key == "wind_speed" and np.isfinite(hint.value)]
    # a density is stated for the wind only, so a single symbol of a speed beside it means the wind
    if "air_density" in conditions and "wind_speed" not in conditions and len(symbols) == 1:
        conditions["wind_speed"], names["wind_speed"] = symbols[0].value, f"{symbols[0].what}, in m/s"
        hints.remove(symbols[0])
    named = {key: "" if names[key] == key else f" ({names[key]})" for key in conditions}
    remarks: list[str] = [
        stated_remark(key, value, f"the file{named[key]}") for key, value in conditions.items()
    ]
    unused += [f"{one_line(name, 40)}: '{one_line(text, 60)}'" for name, text in table.texts.items()]
    more = f" and {len(unused) - _LISTED} more" if len(unused) > _LISTED else ""
    if unused:
        remarks.append(f"stated in the file and not used: {', '.join(unused[:_LISTED])}{more}")
    return conditions, hints, remarks


def stated_remark(key: str, value: float, place: str) -> ImportRemark:
    """The remark that a place states a condition; the table of runs shows the numbers of some conditions."""
    text = f"{key} = {value:g} from {place}"
    return ImportRemark(text, f"{key} from {place}" if key in _IN_TABLE else text)


def _hint(name: str, unit: str, key: str | None, value: float) -> Hint | None:
    """The hint of an unused column or number; ``key``: the condition stated by its name."""
    shown_name = one_line(name, 60)
    number = "" if np.isnan(value) else f" = {value:g}"
    if key is None and (like := resembles(name, unit)) is not None and in_unknown_unit(like, unit):
        key = like
    if key is not None:
        why = f"its unit is not one of {units_of(key)}"
        what = (
            f"'{shown_name}'{number}" if unit in shown_name else f"'{shown_name}' in '{one_line(unit, 20)}'"
        )
        return Hint(key, float("nan"), what, why, f"--set {key}=NUMBER states it")
    key = resembles(name, unit)
    if key is None:
        return None
    option = f'--set {key}="{shown_name}"' if " " in shown_name else f"--set {key}={shown_name}"
    use = f"{option} uses it"
    if key == "wind_speed" and not unit and np.isnan(value) and len(name.strip()) == 1:
        use = f"{use}, --input {shown_name} if it drives the body"
        return Hint(
            key,
            value,
            f"'{shown_name}'",
            "it may be wind_speed or an input, but has no unit",
            use,
            symbol=True,
            option=option,
        )
    if unit:
        value = value * (in_si(key, unit) or 1.0)
        what, why = f"'{shown_name}'{number} in {unit}", "its name is not a condition's"
    else:
        what, why = f"'{shown_name}'{number}", f"it may be {key}, but has no unit"
    return Hint(key, value, what, why, use, option=option)


def _hint_of_several(name: str, key: str) -> Hint:
    """The hint of a name for which a file states several numbers."""
    why = "the file states several numbers"
    use = f"--conditions RUNS.csv states it run by run, --set {key}=NUMBER for all runs"
    return Hint(key, float("nan"), f"'{one_line(name, 60)}'", why, use)


def _from_column(
    key: str, column: Channel, rows: NDArray[np.intp], factor: float
) -> Iterator[tuple[float, str]]:
    """The condition of a run stated by a column, in the unit of `Conditions`, and a remark; nothing without one."""
    values = column.values[rows]
    values = values[np.isfinite(values)]
    if not values.size:
        return
    low, middle, high = map(float, np.quantile(values, (0.05, 0.5, 0.95)))
    if high - low <= _EVEN * abs(middle):
        yield middle * factor, ""
        return
    off = key == "wind_speed" and low <= 0.0 and middle < _OFF * (high - low)
    where = "zero, about which it lies" if off else f"its median, {middle * factor:.6g}"
    remark = f"the column '{column.name}' varies from {low:.4g} to {high:.4g}: {key} is {where}"
    yield 0.0 if off else middle * factor, remark


def of_short_table(table: Table) -> list[Hint]:
    """Apparent statements about the runs in a table too short for a record."""
    found = []
    for channel in table.channels:
        key = condition_of(channel.name, channel.unit) or resembles(channel.name, channel.unit)
        values = channel.values[np.isfinite(channel.values)]
        if key is None or not values.any():
            continue
        what = f"'{one_line(channel.name, 60)}' of {counted(values.size, 'value')}"
        part = f" in '{one_line(table.part, 40)}'" if table.part else ""
        why = f"it may state {key}, but not of which run"
        found.append(Hint(key, float("nan"), what + part, why, "--conditions RUNS.csv states it run by run"))
    return found


def conditions_of(
    stated: Stated,
    file: Path,
    run: str,
    rows: NDArray[np.intp],
    beside: ImportStatements,
    where: str,
) -> tuple[dict[str, float], dict[str, float], list[str]]:
    """The conditions of the run in some rows, and the sizes stated beside them, by key; and remarks."""
    given = beside.choices.conditions.model_dump(include=set(RUN_KEYS), exclude_none=True)
    in_table = {} if beside.table is None else beside.table.of(file, run)
    # precedence: --set, the table, the name of the file, the columns, and other numbers of the file
    measured, remarks = stated.measured(rows)
    found = {**stated.numbers, **measured, **stated.named, **in_table, **given}
    sizes = {key: found.pop(key) for key in OF_CAMPAIGN if key in found}
    sizes = {} if list(sizes) == ["width"] else sizes  # "width" may denote the width of many things
    validate(Conditions, found | sizes, file)
    plausible_values(found | sizes, where)
    return found, sizes, remarks


def ask_conditions(
    table: Table, used: Sequence[Channel], file: Path, beside: ImportStatements, where: str
) -> None:
    """Refuse a table of a file without a condition that only the user can state, before its records are known."""
    stated, _ = find_conditions(table, used, beside.choices, where)
    rows = np.arange(table.channels[0].values.size)
    given = beside.choices.conditions.model_dump(exclude_none=True)
    known = {**stated.numbers, **stated.measured(rows)[0], **beside.of_file(file), **given}
    hints = [*stated.unused(rows), *beside.hints[file]]
    open_conditions(known, known, hints, "", where, driven=True, later=beside.later)


_DENSITY = "--set air_density=1.2"
_OF_AIR = f"{_DENSITY} (kg/m3, about 1.2 for air)"


def open_conditions(
    known: Mapping[str, float],
    sizes: Mapping[str, float | None],
    hints: Sequence[Hint],
    name: str,
    where: str,
    *,
    driven: bool,
    later: bool,
) -> tuple[list[ImportRemark], bool]:
    """Remarks on unused content that resembles a condition, and whether an air density is missing.

    Wind-off is not assumed if a wind is suggested; the other statements that a wind needs are asked for at
    once.

    Args:
        known: known conditions of the run.
        sizes: sizes of the rig; None: not stated.
        name: name of file and run, which may mention a wind.
        later: whether a missing air density may be stated later.

    Raises:
        Unstated: with all conditions that only the user can state.
    """
    open_ones = [hint for hint in hints if hint.key not in known]
    remarks = [doubt(hint.words, hint.short) for hint in open_ones]
    scales = known.get("spring_stiffness"), sizes.get("frontal_area"), sizes.get("reference_length")
    if "wind_speed" in known:
        wind = known["wind_speed"]
        missing = needs_density(wind, *scales) and "air_density" not in known
        if missing and not later:
            what, remedy = f"wind-on ({wind:g} m/s) without air_density", f"give {_OF_AIR}"
            raise Unstated(what, where=where, remedy=remedy, options=(_DENSITY,))
        return remarks, missing
    suggested = {hint.key for hint in open_ones}
    needed = needs_density(1.0, *scales) or "spring_stiffness" in suggested
    dense = not later and needed and "air_density" not in {*known, *suggested}
    beside, options = (f", with {_OF_AIR};", (_DENSITY,)) if dense else (",", ())
    wind_off = "--set wind_speed=0 states wind-off"
    for hint in open_ones:
        letter = hint.symbol and driven  # beside a command it is a velocity or another command
        if hint.key == "wind_speed" and hint.value != 0.0 and not letter:
            left_out = hint.brief.rpartition(";")[0] or f"{hint.what} is left out: {hint.why}"
            what = f"{left_out}; wind-off is not assumed beside it"
            remedy = f"{hint.use}{beside} {wind_off}"
            raise Unstated(what, where=where, remedy=remedy, options=filter(None, (hint.option, *options)))
    if WIND_ON.search(name):
        what = "the name states that the wind is on, but not its speed"
        option = "--set wind_speed=SPEED"
        remedy = f"give {option} (m/s), --conditions or --name{beside.rstrip(',;')}"
        raise Unstated(what, where=where, remedy=remedy, options=(option, *options))
    if not driven:
        remarks.append(
            doubt("wind_speed is not stated: wind-off is assumed; --set wind_speed=SPEED states it")
        )
    return remarks, False
