"""The choices of an import in words: for a recipe, for a field of a page, and for an option of the command line.

The command line answers before pydantic is loaded, so these words are not in `ImportChoices`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from tunnel_sim.vocabulary.errors import one_of
from tunnel_sim.vocabulary.freedom import OWN_INPUT_COLUMNS


@dataclass(frozen=True)
class ChoiceOption:
    """A choice of an import; None: it is found from the files.

    Args:
        group: group of options in the help.
        wanted: words for its values, for the remedy ``give <key> as <wanted>``.
        help: help of the option with the name of the choice; it begins with the title of its field on a page.
        metavar: metavariable of the option; empty: its type.
        kind: type of the value, or of each value if it may have several.
    """

    group: Literal["Columns", "Units", "Conditions", "Runs"]
    wanted: str
    help: str
    metavar: str = ""
    kind: type[str] | type[float] | type[bool] = str
    several: bool = False

    @property
    def title(self) -> str:
        """Title of the field on a page."""
        return re.split(r"[,:.]", self.help, maxsplit=1)[0]


CHOICES: Mapping[str, ChoiceOption] = {
    "angle": ChoiceOption(
        "Columns",
        "a list of names or numbers of columns",
        "Column of the angle, by name or its number in the file. May be repeated.",
        "NAME",
        several=True,
    ),
    "unit": ChoiceOption(
        "Units",
        "the unit of the angle, such as 'deg'",
        "Unit of the angle: rad, mrad, deg, turns, counts, V, deg/s, …",
    ),
    "input": ChoiceOption(
        "Columns",
        "the name of the input's column of a driven run, or 'none'",
        "Column of a driven run's input, or none.",
        "NAME",
    ),
    "input_as": ChoiceOption(
        "Columns",
        one_of([f"'{name}'" for name in OWN_INPUT_COLUMNS]),
        f"What the input is: {one_of(OWN_INPUT_COLUMNS)}.",
        "COLUMN",
    ),
    "input_hold": ChoiceOption(
        "Columns",
        "'zero' or 'linear'",
        "The input between its samples: zero (held) or linear.",
        "HOLD",
    ),
    "time": ChoiceOption(
        "Columns",
        "the name or number of the column of times",
        "Column of the times, by name or number.",
        "NAME",
    ),
    "time_unit": ChoiceOption(
        "Units",
        "the unit of the times, such as 'ms'",
        "Unit of the times: s, ms, us, min, …",
    ),
    "rate": ChoiceOption(
        "Units",
        "a positive number in Hz",
        "Sample rate [Hz], where there are no times.",
        "HZ",
        float,
    ),
    "counts_per_turn": ChoiceOption(
        "Units",
        "a positive number",
        "Counts of an encoder per turn.",
        "NUMBER",
        float,
    ),
    "calibration": ChoiceOption(
        "Units",
        "a formula such as '0.1 + 20*V', or the name of a table of two columns",
        "Angle of a voltage: a formula, also 'b*(V - c)', or a file of two columns.",
        "'a + b*V'",
    ),
    "name": ChoiceOption(
        "Conditions",
        "a pattern of file names such as 'S{spring}_V{wind_speed}_*'",
        "Conditions in the file names: S{spring}_V{wind_speed}_*",
        "PATTERN",
    ),
    "rest": ChoiceOption(
        "Conditions",
        "the reading at rest in rad, to be subtracted from every run",
        "Reading at rest [rad] of every run, which is subtracted.",
        "RAD",
        float,
    ),
    "cut": ChoiceOption(
        "Runs",
        "false to keep records whole",
        "Cut records at releases.",
        kind=bool,
    ),
    "delimiter": ChoiceOption(
        "Columns",
        "'tab', ';', ',', '|' or 'blank'",
        "Delimiter of a text file: tab, blank, ';', ',' or '|'.",
        "SIGN",
    ),
    "decimal": ChoiceOption(
        "Columns",
        "'.' or ','",
        "Decimal sign of a text file: ',' or '.'.",
        "SIGN",
    ),
}
"""By field of `ImportChoices`, in the order of the help."""
