"""Numbers of public functions and classes have their unit, arrays their shape, and fields of files a description.

That there is a docstring is ruff's rule. The packages are walked, so nothing is forgotten; the rules themselves are
tried on planted examples below.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import pkgutil
import re
from collections.abc import Callable, Iterator
from types import ModuleType
from typing import Any

import pydantic
import pytest

from tests.architecture.test_layers import PACKAGES
from tunnel_lab import cli

# Typer turns the arguments of a command into its help; test_cli.py reads that.
COMMANDS = {f"{command.__module__}.{command.__name__}" for command in cli.COMMANDS.values()} | {
    f"tunnel_lab.commands.blind.{name}" for name in ("make", "diagnose", "score")
}
EXEMPT = {"tunnel_lab.cli.tunnel", *COMMANDS}
# The reference simulator is a test oracle with conventions of its own, not an interface.
ORACLES = ("tunnel_reference.",)

UNIT = re.compile(
    r"""(?<![\w/])(
        rad(/s|²|2|/\(N\ m\))?(/s)?(²|2)? | degrees? | °
        | s | Hz | m(/s|²|³)? | kg(/m³|\ m²|\ m2)?
        | N\ m([ ]s)?([ ]s²)?(/rad(/s)?(²)?)? | 1/rad(²|2)? | 1/s
        | 1/s²? | % | pixels | inches | bits? | cycles | SI(\ units)?
        | dimensionless | ratio | fraction | share | count | number\ of | units?
        | radians | in\ the\ unit | probability | threads | seed | index | steps?
        | samples? | \(1\) | factor | likewise
    )(?![\w])""",
    re.VERBOSE,
)
ARRAY = re.compile(r"\bshapes?\b|\bn of them\b|\bper (run|spring|window|sample)\b|\bof each\b|\blikewise\b")
NUMERIC = {"float", "float | None"}
ARRAYS = {"Array", "ArrayLike"}
NAMES_ITS_UNIT = re.compile(r"_(s|deg|hz|rad|rad_per_s|per_rad|n_m_per_rad|percent)$")


def modules() -> Iterator[ModuleType]:
    for package in PACKAGES:
        root = importlib.import_module(package)
        yield root
        for found in pkgutil.walk_packages(root.__path__, package + "."):
            yield importlib.import_module(found.name)


def public_objects() -> Iterator[tuple[str, Any]]:
    """Public functions, classes and methods with the module that defines them."""
    for module in modules():
        for name, member in vars(module).items():
            if name.startswith("_") or getattr(member, "__module__", None) != module.__name__:
                continue
            if inspect.isclass(member):
                yield f"{module.__name__}.{name}", member
                for method_name, method in vars(member).items():
                    if not method_name.startswith("_") and inspect.isfunction(method):
                        yield f"{module.__name__}.{name}.{method_name}", method
            elif inspect.isfunction(inspect.unwrap(member)) if callable(member) else False:
                yield f"{module.__name__}.{name}", inspect.unwrap(member)


def documented_arguments(text: str) -> dict[str, str]:
    """Names and texts under ``Args:`` of a Google-style docstring."""
    section = re.search(r"^Args:\n((?:(?:[ ]{4,}.*)?\n?)*)", inspect.cleandoc(text), re.MULTILINE)
    if section is None:
        return {}
    found: dict[str, str] = {}
    names: list[str] = []
    for line in section[1].splitlines():
        start = re.match(r"[ ]{4}(\w+(?:, \w+)*):\s*(.*)", line)
        if start:
            names = start[1].split(", ")  # several of one kind share a line
            found |= dict.fromkeys(names, start[2])
        for name in () if start else names:
            found[name] += " " + line.strip()
    return found


def arguments(member: Any) -> dict[str, str]:
    """Arguments and their annotations, those of the constructor for a class."""
    try:
        signature = inspect.signature(member)
    except ValueError:
        return {}
    return {
        name: str(parameter.annotation)
        for name, parameter in signature.parameters.items()
        if name not in ("self", "cls") and parameter.kind is not inspect.Parameter.VAR_KEYWORD
    }


def says_it_in_one_line(member: Any) -> bool:
    """A single line may do where there is one argument at most."""
    return len(arguments(member)) <= 1 and "\n" not in inspect.cleandoc(member.__doc__ or "")


def overrides(name: str, member: Any) -> bool:
    """Whether a base class documents the method already."""
    method = name.rpartition(".")[2]
    if not inspect.isfunction(member) or "." not in member.__qualname__:
        return False
    owner = getattr(importlib.import_module(member.__module__), member.__qualname__.split(".")[0])
    return any(getattr(vars(base).get(method), "__doc__", None) for base in owner.__mro__[1:])


def undescribed_fields(name: str, model: type[pydantic.BaseModel]) -> list[str]:
    """Fields of a table of a file format that carry no description; nested tables have their own."""
    return [
        f"{name}: field {field} has no description"
        for field, info in model.model_fields.items()
        if not info.description and "Table" not in str(info.annotation)
    ]


def describes_itself(field: dataclasses.Field[Any]) -> bool:
    """Whether a field carries its unit and its meaning, as the parameters of an effect do."""
    return bool(field.metadata.get("unit") and field.metadata.get("meaning"))


def faults(name: str, member: Any) -> list[str]:
    """What is wrong with one docstring."""
    text = member.__doc__ or ""
    enumerated = inspect.isclass(member) and hasattr(member, "__members__")
    if name in EXEMPT or name.startswith(ORACLES) or enumerated:
        return []
    if says_it_in_one_line(member) or overrides(name, member) or "arguments as in `" in text:
        return []
    if inspect.isclass(member) and issubclass(member, pydantic.BaseModel):
        return undescribed_fields(name, member)
    known, signature = documented_arguments(text), arguments(member)
    if inspect.isclass(member) and dataclasses.is_dataclass(member):
        described = {field.name for field in dataclasses.fields(member) if describes_itself(field)}
        signature = {name: kind for name, kind in signature.items() if name not in described}
    found = [argument_fault(argument, kind, known.get(argument)) for argument, kind in signature.items()]
    return [f"{name}: {fault}" for fault in found if fault]


def argument_fault(argument: str, annotation: str, text: str | None) -> str:
    """What is wrong with the description of one argument; empty where nothing is."""
    if argument.startswith("_") or annotation not in (*NUMERIC, *ARRAYS):
        return ""
    if text is None:
        return f"argument {argument} is not documented"
    if annotation in NUMERIC and not (UNIT.search(text) or NAMES_ITS_UNIT.search(argument)):
        return f"argument {argument} has no unit: {text!r}"
    return (
        f"argument {argument} has no shape: {text!r}"
        if annotation in ARRAYS and not ARRAY.search(text)
        else ""
    )


def test_every_number_has_its_unit_and_every_array_its_shape() -> None:
    found = list(public_objects())
    assert len(found) > 100  # the walk walks
    wrong = [fault for name, member in found for fault in faults(name, member)]
    assert not wrong, "\n".join(wrong)


def good(speed: float, count: int) -> float:
    """Something.

    Args:
        speed: V, m/s.
    """
    return speed * count


def undocumented_argument(speed: float, count: int) -> float:
    """Something.

    Args:
        count: of runs.
    """
    return speed * count


def without_unit(speed: float, count: int) -> float:
    """Something.

    Args:
        speed: of the wind.
        count: of runs.
    """
    return speed * count


def without_a_shared_unit(low: float, high: float) -> float:
    """Something.

    Args:
        low, high: ends of the band.
    """
    return high - low


@dataclasses.dataclass
class HalfDescribed:
    """Something."""

    speed: float = dataclasses.field(metadata={"unit": "m/s", "meaning": "of the wind"})
    angle: float = dataclasses.field(metadata={"unit": "rad"})


@pytest.mark.parametrize(
    ("function", "fault"),
    [
        (HalfDescribed, "argument angle is not documented"),
        (undocumented_argument, "argument speed is not documented"),
        (without_unit, "argument speed has no unit"),
        (without_a_shared_unit, "argument high has no unit"),
    ],
)
def test_planted_faults_are_found(function: Callable[..., object], fault: str) -> None:
    assert [text for text in faults("planted", function) if fault in text]


def test_a_good_docstring_has_no_fault() -> None:
    assert faults("good", good) == []
