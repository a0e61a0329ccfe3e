"""The estimate of one simulated campaign, as rows of a table; a failed estimate must not stop the others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import polars as pl

from identification import identify
from identification.estimate import UNITS
from identification.returned import WrongReturn
from tunnel_sim.vocabulary.errors import TunnelError, one_line, own_traceback, raised_line

if TYPE_CHECKING:
    from identification.estimate import Estimate, RunEstimate
    from identification.estimators import Estimator
    from tunnel_sim.vocabulary.campaign import Campaign

REFUSED, RAISED, WRONG = "refused", "raised", "wrong_return"
"""The campaign was refused, the estimator raised an exception, or it did not return an estimate."""
VERBS = {REFUSED: "refused", RAISED: "raised an exception", WRONG: "returned no valid estimate"}
"""Statuses of failures in words."""

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
    "coefficients_withheld",
)
"""Statuses with which a value is missing because the runs cannot give it, or the estimator does not.

These are not failures of the estimator.
"""


@dataclass(frozen=True)
class Failure:
    """The reason why a campaign has no estimate.

    Args:
        status: one of `VERBS`, or another reason stated by the caller.
        message: one line.
        shown: the details from which a user can find the cause: a traceback, or the line.
        error: name of the exception's type; empty without an exception.
    """

    status: str
    message: str
    shown: str = ""
    error: str = ""

    def of(self, estimator: str) -> Failed:
        """The failure of one estimator."""
        return Failed(estimator, self.status, 1, self.shown)


def asked(campaign: Campaign, estimator: str | Estimator) -> Estimate | Failure:
    """The estimate of a campaign, or the reason why it is missing."""
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
    """Failures of one status of an estimator: their number, and the details of the first."""

    estimator: str
    status: str
    count: int
    first: str

    @property
    def of_the_estimator(self) -> bool:
        """Whether the fault is in the code of the estimator, not in the campaign."""
        return self.status in (RAISED, WRONG)

    @property
    def lines(self) -> tuple[str, str]:
        """The failures in words, and the details of the first."""
        times = "once" if self.count == 1 else f"{self.count} times"
        return f"{self.estimator} {VERBS[self.status]} {times}; counted as failures. The first:", self.first


def counted_failures(failures: Iterable[Failed]) -> tuple[Failed, ...]:
    """Failures by estimator and status, each with the details of the first; only statuses in `VERBS`."""
    found: dict[tuple[str, str], Failed] = {}
    for one in failures:
        key = one.estimator, one.status
        before = found.get(key, Failed(*key, 0, one.first))
        found[key] = Failed(*key, before.count + one.count, before.first)
    return tuple(one for one in found.values() if one.status in VERBS)


def failures_in(table: pl.DataFrame, by: Sequence[str], known: Iterable[Failed]) -> tuple[Failed, ...]:
    """The failures in a table of results, also from an earlier command.

    Args:
        table: table with ``estimator``, ``status`` and ``message``.
        by: the columns that name a campaign.
        known: failures of this command, with their details.
    """
    first = {(one.estimator, one.status): one.first for one in known}
    kind = pl.col("status").str.split(" ").list.first()
    found = (
        table.with_columns(kind=kind)
        .filter(pl.col("kind").is_in(list(VERBS)))
        .group_by("estimator", "kind", maintain_order=True)
        .agg(count=pl.struct(by).n_unique(), message=pl.col("message").first())
    )
    rows = found.iter_rows()
    return tuple(Failed(name, kind, count, first.get((name, kind), line)) for name, kind, count, line in rows)


QUANTITY_COLUMNS: Mapping[str, Any] = {
    **dict.fromkeys(("quantity", "unit"), pl.String),
    **dict.fromkeys(("truth", "value", "std", "bound"), pl.Float64),
    "status": pl.String,
}
"""Columns of a quantity; truth, value, std and bound are in its unit."""


QUANTITY_UNITS: Mapping[str, str] = {**UNITS, "sensor_zero": "rad", "zeta": "1", "omega_n": "rad/s"}


def quantity_rows(
    estimate: Estimate | RunEstimate | None,
    names: Iterable[str],
    truth: Mapping[str, float],
    bound: Mapping[str, float],
    status: str,
) -> Iterator[tuple[Any, ...]]:
    """A row of `QUANTITY_COLUMNS` for each quantity.

    Args:
        estimate: the estimate; None if there is none.
        names: names of the quantities.
        truth: true values by quantity, in its unit; quantities without one may be left out.
        bound: Cramér–Rao bound, by quantity, in its unit.
    """
    for name in names:
        quantity = getattr(estimate, name, None)
        value, std = (None, None) if quantity is None else (quantity.value, quantity.std)
        yield name, QUANTITY_UNITS[name], truth.get(name), value, std, bound.get(name), status


def not_given(table: pl.DataFrame | pl.LazyFrame) -> dict[str, tuple[str, ...]]:
    """Quantities by estimator that it gives in no row, unless its status is a failure in all of them.

    Failures are exceptions, and campaigns in which no run could be identified.

    Args:
        table: table with the columns ``estimator``, ``quantity``, ``value`` and ``status``.
    """
    absent = (
        table.lazy()
        .group_by("estimator", "quantity", maintain_order=True)
        .agg(given=pl.col("value").is_not_null().any(), excused=pl.col("status").is_in(NOT_ASKED).any())
        .filter(pl.col("excused") & ~pl.col("given"))
        .group_by("estimator", maintain_order=True)
        .agg("quantity")
        .collect()
    )
    return {name: tuple(quantities) for name, quantities in absent.iter_rows()}
