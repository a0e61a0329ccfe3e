"""The options of a command, made from the types of its arguments, and options common to all commands."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from copy import copy
from dataclasses import MISSING, fields, is_dataclass
from functools import wraps
from inspect import Parameter, Signature, signature
from typing import Annotated, Any, get_args, get_origin, get_type_hints

from typer import Option

from tunnel_lab.terminal.table_format import TableFormat, chosen, quiet

EVERY = "As for every command"
"""The part of the help that lists the options common to all commands."""


def with_fields(run: Callable[..., None]) -> Callable[..., None]:
    """A command with an option for each field of the dataclasses that it takes.

    Parameters and fields are annotated as for Typer; a ``tuple[T, ...]`` may be given repeatedly. A mapping in
    the annotation of a dataclass has other help texts for some of its fields, which then come last.
    """
    given = signature(run, eval_str=True).parameters.values()
    models: dict[str, Any] = {
        one.name: model for one in given if is_dataclass(model := _parts(one.annotation)[0])
    }
    options = [option for one in given for option in _options(one)]
    repeated = [option.name for option in options if _is_repeated(option)]

    @wraps(run)
    def wider(**named: Any) -> None:
        named |= {name: tuple(named[name] or ()) for name in repeated if name in named}
        for name, model in models.items():
            names = [field.name for field in fields(model) if field.name in named]
            named[name] = model(**{field: named.pop(field) for field in names})
        run(**named)

    return _declared(wider, map(_as_list, options))


def _parts(annotation: Any) -> tuple[Any, ...]:
    """A type and all its annotations."""
    return get_args(annotation) if get_origin(annotation) is Annotated else (annotation,)


def _options(parameter: Parameter) -> Iterator[Parameter]:
    """The parameter, or one option for each field of its dataclass."""
    model, *annotated = _parts(parameter.annotation)
    if not is_dataclass(model):
        yield parameter.replace(kind=Parameter.KEYWORD_ONLY)
        return
    (helps,) = annotated or ({},)
    kinds = get_type_hints(model, include_extras=True)
    defaults = {field.name: field.default for field in fields(model)}
    for name in (*(name for name in defaults if name not in helps), *helps):
        kind, option = _parts(kinds[name])
        if name in helps:
            option = copy(option)
            option.help = helps[name]
        default = Parameter.empty if defaults[name] is MISSING else defaults[name]
        yield Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, option])


def _is_repeated(option: Parameter) -> bool:
    """Whether the type is a tuple of any length."""
    kind = _parts(option.annotation)[0]
    return get_origin(kind) is tuple and get_args(kind)[1:] == (...,)


def _as_list(option: Parameter) -> Parameter:
    """A repeated option in Typer's form: a list, None by default."""
    if not _is_repeated(option):
        return option
    kind, word = _parts(option.annotation)
    as_list: Any = list[get_args(kind)[0]]  # type: ignore[misc]  # a type that is known when it runs
    return option.replace(annotation=Annotated[as_list, word], default=option.default or None)


def with_format(run: Callable[..., None]) -> Callable[..., None]:
    """A command with ``--quiet``, and with ``--format`` for its printed tables."""
    option = Option(
        "--format",
        metavar="FORMAT",
        rich_help_panel=EVERY,
        help="Format of the tables: text, csv, md or json (one object per line). "
        "Other lines then go to standard error.",
    )
    return _with_option(with_quiet(run), "table_format", Annotated[TableFormat, option], chosen)


def with_quiet(run: Callable[..., None]) -> Callable[..., None]:
    """A command with the option ``--quiet``."""
    text = "Print errors only; files and --json - are still written."
    option = Option("--quiet", "-q", rich_help_panel=EVERY, help=text)
    return _with_option(with_fields(run), "quiet", Annotated[bool, option], quiet)


def _with_option(
    run: Callable[..., None], name: str, kind: Any, variable: ContextVar[Any]
) -> Callable[..., None]:
    """A command with one more option; its value is in a context variable while the command runs."""
    default = variable.get()

    @wraps(run)
    def wider(**named: Any) -> None:
        token = variable.set(named.pop(name, default))
        try:
            run(**named)
        finally:
            variable.reset(token)

    option = Parameter(name, Parameter.KEYWORD_ONLY, default=default, annotation=kind)
    return _declared(wider, [*signature(run).parameters.values(), option])


def _declared(run: Callable[..., None], options: Iterable[Parameter]) -> Callable[..., None]:
    """The command with a signature for Typer, which finds annotations only if they are not strings."""
    whole = Signature(list(options))
    vars(run)["__signature__"] = whole
    run.__annotations__ = {name: option.annotation for name, option in whole.parameters.items()}
    return run
