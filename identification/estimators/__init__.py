"""The estimators, one per file, and their registry, with estimators of installed packages and registered ones.

To add one, write a frozen dataclass with the members of `Estimator`; its fields are the settings. Add a line to
`SUMMARIES`. The file has the estimator's name, and the class has that name in CamelCase, as in
``output_error.OutputError``. It is imported when the estimator is made, so heavy imports are deferred until
then.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Protocol, TypeVar, cast

from tunnel_sim.vocabulary.errors import TunnelError, added_to, did_you_mean, loading, one_line

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.vocabulary.campaign import Campaign


class Estimator(Protocol):
    """An identification method with its settings.

    A class that also states ``takes_driven = True`` gets the driven runs of a campaign, with their inputs;
    other classes refuse a campaign with driven runs.
    """

    name: ClassVar[str]

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify a campaign; a failure is a status of the estimate, never NaN.

        Args:
            campaign: at least one run.

        Returns:
            The estimate, its runs in the campaign's order.
        """


SUMMARIES: Mapping[str, str] = {
    "output_error": "maximum likelihood over all runs at once",
    "conventional": "the paper's: spectrum, time to half amplitude, each wind-on run paired with wind-off "
    "runs of its spring",
    "neural_network": "the paper's: one network for damping, one for frequency, three cycles at a time, paired "
    "in the same way",
    "matrix_pencil": "poles by linear algebra, run by run: the fastest, and nearly as accurate",
    "log_decrement": "weighted regression of the logarithms of all peaks, run by run: the classical manual method",
    "hilbert": "envelope and phase, run by run; its windows are damping and frequency against amplitude",
    "filter_error": "maximum likelihood with a random moment on the model: for runs with buffeting",
    "bayesian": "posterior means and 95 % intervals that are valid for records of one to three cycles",
    "neural_posterior": "posterior by a trained network: robust to unnamed effects; refuses records unlike "
    "its training",
    "frequency_response": "response over input, line by line where both are coherent: for driven runs only",
}
"""Method and purpose of each estimator by name, one line for the help of the command line."""

DRIVEN_ONLY: tuple[str, ...] = ("frequency_response",)
"""Estimators that do not take free decays."""

ALL_ESTIMATORS: tuple[str, ...] = tuple(name for name in SUMMARIES if name not in DRIVEN_ONLY)
"""The packaged estimators that take free decays."""


ENTRY_POINTS = "tunnel.estimators"
"""Group of the entry points by which an installed package adds estimators: the name, and a class that needs no
arguments."""

KindT = TypeVar("KindT", bound=type[Any])

_registered: dict[str, type[Any]] = {}
_REMEDY = "state a name and a method estimate(campaign), and let the class need no arguments"


def register_estimator(kind: KindT) -> KindT:
    """Add your own estimator by its name; also as a decorator.

    Args:
        kind: a class with the members of `Estimator` that needs no arguments. It replaces an earlier class of the
            same name.

    Raises:
        TunnelError: when it is not such a class, or has the name of a packaged estimator.
    """
    where = f"estimator {one_line(getattr(kind, 'name', kind))}"
    name = getattr(kind, "name", None)
    if (
        not isinstance(kind, type)
        or not callable(getattr(kind, "estimate", None))
        or not isinstance(name, str)
    ):
        raise TunnelError("is not a class of an estimator", where=where, remedy=_REMEDY)
    if not name.isidentifier():
        raise TunnelError("is not a name for an estimator", where=where, remedy="use letters, digits and _")
    if name in SUMMARIES:
        raise TunnelError("is the name of a packaged estimator", where=where, remedy="choose another name")
    try:
        kind()
    except (Exception, SystemExit) as error:
        what = f"cannot be made without arguments ({type(error).__name__}: {one_line(error)})"
        raise TunnelError(what, where=where, remedy="give each setting a default") from error
    _registered[name] = kind
    return kind


def register_from(word: str) -> str:
    """Register the class named by a word ``module:Class``, and return the name of the estimator.

    Args:
        word: the module and the class; Python imports the module from the folders of ``sys.path``.

    Raises:
        TunnelError: when the module or class cannot be loaded, or is not an estimator.
    """
    module, _, place = word.partition(":")
    if not module or not place:
        what = f"names no {'module' if not module else 'class'}"
        raise TunnelError(what, where=word, remedy="give it as module:Class")
    if module.endswith(".py"):
        remedy = f"leave out .py: {module.removesuffix('.py').replace('/', '.')}:{place}"
        raise TunnelError("names a file, not a module", where=word, remedy=remedy)
    with loading(word, "give it as module:Class, and correct the module"):
        kind = import_module(module)
        for part in place.split("."):
            kind = getattr(kind, part)
    return str(register_estimator(cast("type[Any]", kind)).name)


def known_estimators() -> tuple[str, ...]:
    """The names of all estimators: packaged ones, then from installed packages, then registered ones."""
    return tuple(dict.fromkeys((*SUMMARIES, *added_to(ENTRY_POINTS), *_registered)))


def make_estimator(name: str) -> Estimator:
    """An estimator by name, with its default settings.

    Args:
        name: one of `known_estimators`.

    Raises:
        TunnelError: when there is no such estimator, naming the closest one; or when an installed package's
            entry of that name is not an estimator.
    """
    if name in _registered:
        return cast("Estimator", _registered[name]())
    if name in SUMMARIES:
        kind = name.title().replace("_", "")
        return cast("Estimator", getattr(import_module(f"{__name__}.{name}"), kind)())
    added = added_to(ENTRY_POINTS)
    if name not in added:
        raise TunnelError(
            f"no estimator {name!r}", where="identify", remedy=did_you_mean(name, known_estimators())
        )
    with loading(f"entry point {ENTRY_POINTS}: {name}"):
        estimator = added[name].load()()
        if getattr(estimator, "name", None) != name or not callable(getattr(estimator, "estimate", None)):
            raise TunnelError(
                f"is not an estimator named {name}", remedy="state its name and its method estimate"
            )
    return cast("Estimator", estimator)


def free_decay_estimators() -> tuple[str, ...]:
    """The names of all estimators that take free decays."""
    return tuple(name for name in known_estimators() if name not in DRIVEN_ONLY)


def takes_driven(estimator: Estimator) -> bool:
    """Whether an estimator takes the input of driven runs: its attribute ``takes_driven``; False if missing."""
    return bool(getattr(estimator, "takes_driven", False))


def estimators_of_driven_runs() -> tuple[str, ...]:
    """The names of all loadable estimators that take driven runs."""
    found = []
    for name in known_estimators():
        with suppress(TunnelError):
            found += [name] if takes_driven(make_estimator(name)) else []
    return tuple(found)


def summary_of(name: str) -> str:
    """One line on an estimator: from `SUMMARIES`, or the first line of a user's docstring."""
    if name in SUMMARIES:
        return SUMMARIES[name]
    with suppress(TunnelError):
        text = (type(make_estimator(name)).__doc__ or "").strip()
        return text.partition("\n")[0].removesuffix(".")
    return "cannot be loaded"


@dataclass(frozen=True)
class Own:
    """A user's estimator, in a form that other processes can load.

    Args:
        place: ``module:Class`` of a registered class that other processes can import; empty for a class of an
            installed package, and for a class from a prompt, a notebook or the inside of a function.
        code: the first digits of the SHA-256 of the file of its module; empty without a file.
    """

    name: str
    place: str
    code: str

    def register(self) -> None:
        """Register it in this process.

        Raises:
            TunnelError: when this process cannot import it.
        """
        if self.name in known_estimators():
            return
        if not self.place:
            raise TunnelError(
                "other processes cannot import its class",
                where=f"estimator {self.name}",
                remedy="write it at the top level of a file, or use 0 processes",
            )
        register_from(self.place)


def own_estimators(names: Iterable[str]) -> tuple[Own, ...]:
    """The members of a list of estimators that are not packaged."""
    found = []
    for name in names:
        if name in SUMMARIES:
            continue
        kind = _registered.get(name) or type(make_estimator(name))
        module = sys.modules.get(kind.__module__)
        file = getattr(module, "__file__", None)
        importable = file is not None and getattr(module, kind.__qualname__, None) is kind
        place = f"{kind.__module__}:{kind.__qualname__}" if name in _registered and importable else ""
        code = "" if file is None else hashlib.sha256(Path(file).read_bytes()).hexdigest()[:12]
        found.append(Own(name, place, code))
    return tuple(found)
