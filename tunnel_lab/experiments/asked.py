"""The estimate of one simulated campaign: one bad answer must not stop the others."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from identification import identify
from identification.returned import WrongReturn
from tunnel_sim.vocabulary.errors import TunnelError, one_line, own_traceback, raised_line

if TYPE_CHECKING:
    from identification.estimate import Estimate
    from identification.estimators import Estimator
    from tunnel_sim.vocabulary.campaign import Campaign

REFUSED, RAISED, WRONG = "refused", "raised", "wrong_return"
"""The campaign was refused, the estimator raised an exception, or it returned something else than an estimate."""
VERBS = {REFUSED: "refused", RAISED: "raised an exception", WRONG: "returned no valid estimate"}
"""What an estimator did, by status."""

NOT_ASKED = (
    "ok",
    "model_departs",
    "noise_disagrees",
    "no_stiffness",
    "no_wind_on",
    "no_wind_off_pair",
    "stiffness_not_separable",
    "damping_not_separable",
    "no_reference_size",
)
"""Statuses beside which a value is absent because the runs cannot give it, or the estimator does not.

These are not failures of the estimator.
"""


@dataclass(frozen=True)
class Failure:
    """The reason why a campaign has no estimate.

    Args:
        status: one of `VERBS`, or another reason stated by the caller.
        message: one line.
        shown: the details for a user to find the cause: a traceback, or the line.
        error: name of the exception's type; empty without an exception.
    """

    status: str
    message: str
    shown: str = ""
    error: str = ""


def asked(campaign: Campaign, estimator: str | Estimator) -> Estimate | Failure:
    """The estimate of a campaign, or the reason for its absence."""
    try:
        return identify(campaign, estimator, throw=False)
    except WrongReturn as error:
        return Failure(WRONG, one_line(error), str(error), type(error).__name__)
    except TunnelError as error:
        return Failure(REFUSED, one_line(error), str(error), type(error).__name__)
    except (Exception, SystemExit) as error:  # all exceptions of an estimator are counted and shown
        return Failure(RAISED, one_line(raised_line(error)), own_traceback(error), type(error).__name__)


@dataclass(frozen=True)
class Failed:
    """Failures of one status: their number, and the details of the first."""

    status: str
    count: int
    first: str

    @property
    def of_the_estimator(self) -> bool:
        """Whether the code of the estimator is at fault, and not the campaign."""
        return self.status in (RAISED, WRONG)


def counted_failures(failures: Iterable[Failure | Failed]) -> tuple[Failed, ...]:
    """Failures by status in the order of `VERBS`, each with the first failure; other statuses are left out."""
    found: dict[str, Failed] = {}
    for one in failures:
        number, text = (one.count, one.first) if isinstance(one, Failed) else (1, one.shown)
        before = found.get(one.status, Failed(one.status, 0, text))
        found[one.status] = Failed(one.status, before.count + number, before.first)
    return tuple(found[status] for status in VERBS if status in found)
