"""Commands that take values, whose fields are single options on the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer import Argument, Option
from typer.testing import CliRunner

from tunnel_lab.commands.blind import MixtureOptions
from tunnel_lab.commands.files import StatedChoices
from tunnel_lab.terminal.arguments import LeaveOutOption
from tunnel_lab.terminal.options import with_fields, with_format
from tunnel_lab.terminal.table_format import TableFormat, chosen
from tunnel_reference.draw import Mixture
from tunnel_sim.files.importing.choices import ImportChoices


@dataclass(frozen=True)
class Release:
    angle: Annotated[float, Option("--angle", min=0, help="In degrees.")]
    spring: Annotated[int | None, Option("--spring", help="Its number.")] = None
    effects: Annotated[tuple[str, ...], Option("--effect", help="To add.")] = ()
    span: Annotated[tuple[float, float], Option("--span", help="Of time.")] = (0.0, 1.0)


def run(command: Callable[..., None], *words: str) -> tuple[int, str]:
    app = typer.Typer()
    app.command()(command)
    result = CliRunner().invoke(app, words, env={"COLUMNS": "120"})
    return result.exit_code, result.output


@pytest.fixture
def seen() -> list[object]:
    return []


@pytest.fixture
def command(seen: list[object]) -> Callable[..., None]:
    def measure(
        files: Annotated[tuple[Path, ...], Argument()],
        *,
        release: Annotated[Release, {"angle": "In rad."}],
        leave_out: LeaveOutOption = (),
        fast: Annotated[bool, Option("--fast")] = False,
    ) -> None:
        """Measure runs."""
        seen.extend((files, release, leave_out, fast))

    return measure


def test_a_value_is_filled_from_an_option_for_each_of_its_fields(
    command: Callable[..., None], seen: list[object]
) -> None:
    words = ("a.csv", "b.csv", "--angle", "5", "--effect", "x", "--effect", "y,z", "--span", "2", "3")
    status, out = run(with_fields(command), *words, "--leave-out", "r1,r2", "--leave-out", "r3", "--fast")
    assert (status, out) == (0, "")
    release = Release(5.0, effects=("x", "y,z"), span=(2.0, 3.0))
    assert seen == [(Path("a.csv"), Path("b.csv")), release, ("r1", "r2", "r3"), True]


def test_fields_that_are_not_given_have_the_defaults_of_the_class(
    command: Callable[..., None], seen: list[object]
) -> None:
    assert run(with_fields(command), "a.csv", "--angle", "5") == (0, "")
    assert seen == [(Path("a.csv"),), Release(5.0), (), False]


@pytest.mark.parametrize("words", [("a.csv",), ("--angle", "5"), ("a.csv", "--angle", "-1")])
def test_a_missing_field_and_one_out_of_range_are_refused(
    command: Callable[..., None], seen: list[object], words: tuple[str, ...]
) -> None:
    status, _ = run(with_fields(command), *words)
    assert (status, seen) == (2, [])


def test_the_help_has_the_fields_and_the_words_of_the_command_last(command: Callable[..., None]) -> None:
    status, out = run(with_fields(command), "--help")
    assert status == 0
    assert "Measure runs." in out
    order = [
        out.index(word) for word in ("--spring", "--effect", "--span", "--angle", "--leave-out", "--fast")
    ]
    assert order == sorted(order)
    assert "In rad." in out
    assert "In degrees." not in out


def test_options_of_every_command_hold_while_the_command_runs() -> None:
    formats = []

    def tabulate() -> None:
        formats.append(chosen.get())

    assert run(with_format(tabulate), "--format", "csv") == (0, "")
    assert formats == [TableFormat.CSV]
    assert chosen.get() is TableFormat.TEXT


def test_options_have_the_names_of_the_fields_that_they_fill() -> None:
    beside = {"table", "settings", "recipe"}  # a table, texts of conditions, and another import's choices
    assert {field.name for field in fields(StatedChoices)} - beside <= set(ImportChoices.model_fields)
    assert {field.name for field in fields(MixtureOptions)} <= {field.name for field in fields(Mixture)}
