"""The estimators, one per file, and their registry.

To add one, write a frozen dataclass in its own file, whose fields are its settings and which has the members of
`Estimator`, and add an entry below. An entry is only data, so a heavy import such as torch waits until the
estimator is used. The conformance suite runs over all entries.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, ClassVar, Protocol, cast

from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean

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


@dataclass(frozen=True)
class Entry:
    """Where an estimator is found.

    Args:
        name: in the registry, in JSON and on the command line.
        factory: the class in it; called without arguments it has its default settings.
        summary: one line for the help of the command line: the method and its purpose.
    """

    name: str
    module: str
    factory: str
    summary: str


ENTRIES: tuple[Entry, ...] = (
    Entry(
        "output_error",
        "identification.estimators.output_error",
        "OutputError",
        "maximum likelihood over all runs at once",
    ),
    Entry(
        "conventional",
        "identification.estimators.conventional",
        "Conventional",
        "the paper's: spectrum, time to half amplitude, each wind-on run paired with wind-off runs of its spring",
    ),
    Entry(
        "neural_network",
        "identification.estimators.neural",
        "NeuralNetwork",
        "the paper's: one network for damping, one for frequency, three cycles at a time, paired in the same way",
    ),
    Entry(
        "matrix_pencil",
        "identification.estimators.matrix_pencil",
        "MatrixPencil",
        "poles by linear algebra, run by run: the fastest, and nearly as accurate",
    ),
    Entry(
        "log_decrement",
        "identification.estimators.log_decrement",
        "LogDecrement",
        "weighted regression of the logarithms of all peaks, run by run: the classical manual method",
    ),
    Entry(
        "hilbert",
        "identification.estimators.hilbert",
        "Hilbert",
        "envelope and phase, run by run; its windows are damping and frequency against amplitude",
    ),
    Entry(
        "filter_error",
        "identification.estimators.filter_error",
        "FilterError",
        "maximum likelihood with a random moment on the model: for runs with buffeting",
    ),
    Entry(
        "bayesian",
        "identification.estimators.bayesian",
        "Bayesian",
        "posterior means and 95 % intervals that are valid for records of one to three cycles",
    ),
)

ALL_ESTIMATORS: tuple[str, ...] = tuple(entry.name for entry in ENTRIES)


def make_estimator(name: str) -> Estimator:
    """An estimator by name, with its default settings.

    Args:
        name: one of `ALL_ESTIMATORS`.

    Raises:
        TunnelError: when there is no such estimator; the error names the closest one.
    """
    for entry in ENTRIES:
        if entry.name == name:
            return cast("Estimator", getattr(import_module(entry.module), entry.factory)())
    raise TunnelError(f"no estimator {name!r}", where="identify", remedy=did_you_mean(name, ALL_ESTIMATORS))
