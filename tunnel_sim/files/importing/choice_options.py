"""The choices of an import in words: for a recipe, for a field of a page, and for an option of the command line.

The command line answers before pydantic is loaded, so the words are here and not in `ImportChoices`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from tunnel_sim.vocabulary.errors import one_of
from tunnel_sim.vocabulary.input_kinds import INPUT_COLUMNS


@dataclass(frozen=True)
class ChoiceOption:
    """A choice of an import, None where it is found from the files.

    Args:
        group: of options in the help.
        title: of its field on a page.
        wanted: its values, for the remedy ``give <key> as <wanted>``.
        help: of its option, which has the name of the choice.
        metavar: of its option; empty: its type.
        kind: type of the value, or of each value where it may have several.
    """

    group: Literal["Columns", "Units", "Conditions", "Runs"]
    title: str
    wanted: str
    help: str
    metavar: str = ""
    kind: type[str] | type[float] | type[bool] = str
    several: bool = False


CHOICES: Mapping[str, ChoiceOption] = {
    "angle": ChoiceOption(
        "Columns",
        "Column of the angle",
        "a list of names or numbers of columns",
        "Column of the angle, by name or its number in the file. May be repeated.",
        "NAME",
        several=True,
    ),
    "unit": ChoiceOption(
        "Units",
        "Unit of the angle",
        "the unit of the angle, such as 'deg'",
        "Unit of the angle: rad, mrad, deg, turns, counts, V, deg/s, …",
    ),
    "input": ChoiceOption(
        "Columns",
        "Column of a driven run's input",
        "the name of the input's column of a driven run, or 'none'",
        "Column of a driven run's input, or none.",
        "NAME",
    ),
    "input_as": ChoiceOption(
        "Columns",
        "What the input is",
        one_of([f"'{name}'" for name in INPUT_COLUMNS]),
        f"What the input is: {one_of(INPUT_COLUMNS)}.",
        "COLUMN",
    ),
    "input_hold": ChoiceOption(
        "Columns",
        "The input between its samples",
        "'zero' or 'linear'",
        "The input between its samples: zero (held) or linear.",
        "HOLD",
    ),
    "time": ChoiceOption(
        "Columns",
        "Column of the times",
        "the name or number of the column of times",
        "Column of the times, by name or number.",
        "NAME",
    ),
    "time_unit": ChoiceOption(
        "Units",
        "Unit of the times",
        "the unit of the times, such as 'ms'",
        "Unit of the times: s, ms, us, min, …",
    ),
    "rate": ChoiceOption(
        "Units",
        "Sample rate [Hz]",
        "a positive number in Hz",
        "Sample rate, where there are no times.",
        "HZ",
        float,
    ),
    "counts_per_turn": ChoiceOption(
        "Units",
        "Counts of an encoder per turn",
        "a positive number",
        "Counts of an encoder per turn.",
        "NUMBER",
        float,
    ),
    "calibration": ChoiceOption(
        "Units",
        "Angle of a voltage",
        "a formula such as '0.1 + 20*V', or the name of a table of two columns",
        "Volts to angle: a formula, also 'b*(V - c)', or a file of two columns.",
        "'a + b*V'",
    ),
    "name": ChoiceOption(
        "Conditions",
        "Conditions in the file names",
        "a pattern of file names such as 'S{spring}_V{wind_speed}_*'",
        "Conditions in the file names: S{spring}_V{wind_speed}_*",
        "PATTERN",
    ),
    "rest": ChoiceOption(
        "Conditions",
        "Reading at rest [rad]",
        "the reading at rest in rad, to be subtracted from every run",
        "Reading at rest of every run: it is subtracted.",
        "RAD",
        float,
    ),
    "cut": ChoiceOption(
        "Runs",
        "Cut records at releases",
        "false to keep records whole",
        "Cut records at releases.",
        kind=bool,
    ),
    "delimiter": ChoiceOption(
        "Columns",
        "Delimiter of a text file",
        "'tab', ';', ',', '|' or 'blank'",
        "Delimiter of a text file: tab, blank, ';', ',' or '|'.",
        "SIGN",
    ),
    "decimal": ChoiceOption(
        "Columns",
        "Decimal sign of a text file",
        "'.' or ','",
        "Decimal sign of a text file: ',' or '.'.",
        "SIGN",
    ),
}
"""By field of `ImportChoices`, in the order of the help."""
