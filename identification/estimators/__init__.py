"""The estimators, one per file, and their registry.

To add one, write a frozen dataclass with the members of `Estimator`, whose fields are its settings, and add a
line to `SUMMARIES`. The file has the estimator's name, and the class has that name in CamelCase, as in
``output_error.OutputError``. It is imported when the estimator is made, so heavy imports wait until then.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, ClassVar, Protocol, cast

from tunnel_sim.vocabulary.errors import TunnelError, added_to, did_you_mean, loading

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from tunnel_sim.vocabulary.campaign import Campaign


class Estimator(Protocol):
    """An identification method with its settings."""

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
    "neural_posterior": "posterior by a trained network: robust to unnamed effects; refuses what is unlike "
    "its training",
    "frequency_response": "response over input, line by line where both are coherent: for driven runs only",
}
"""Method and purpose of each estimator by name, one line for the help of the command line."""

DRIVEN_ONLY: tuple[str, ...] = ("frequency_response",)
"""Those that do not take free decays."""

ALL_ESTIMATORS: tuple[str, ...] = tuple(name for name in SUMMARIES if name not in DRIVEN_ONLY)
"""Those that take free decays."""


ENTRY_POINTS = "tunnel.estimators"
"""Group of the entry points by which an installed package adds estimators: the name, and a class that needs no
arguments."""


def known_estimators() -> tuple[str, ...]:
    """The names of all estimators: the packaged ones, then those that installed packages add."""
    return (*SUMMARIES, *(name for name in added_to(ENTRY_POINTS) if name not in SUMMARIES))


def make_estimator(name: str) -> Estimator:
    """An estimator by name, with its default settings.

    Args:
        name: one of `known_estimators`.

    Raises:
        TunnelError: when there is no such estimator, naming the closest one; or when an installed package states
            something else than an estimator of that name.
    """
    if name in SUMMARIES:
        kind = name.title().replace("_", "")
        return cast("Estimator", getattr(import_module(f"{__name__}.{name}"), kind)())
    added = added_to(ENTRY_POINTS)
    if name not in added:
        raise TunnelError(
            f"no estimator {name!r}", where="identify", remedy=did_you_mean(name, known_estimators())
        )
    with loading(ENTRY_POINTS, name):
        estimator = added[name].load()()
        if getattr(estimator, "name", None) != name or not callable(getattr(estimator, "estimate", None)):
            raise TunnelError(
                f"is not an estimator named {name}", remedy="state its name and its method estimate"
            )
    return cast("Estimator", estimator)
