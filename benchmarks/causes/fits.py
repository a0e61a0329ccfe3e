"""The project's own fits, for methods that select causes in another way; no other file here depends on their
implementation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.causes.entry import KINDS
from diagnosis.answer.held_out import one_more
from diagnosis.diagnosable import comparable_runs, diagnosable
from diagnosis.model.data import Data
from diagnosis.search.investigate import investigate, nominal_study
from diagnosis.search.prepared import fit_nominal
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.campaign import Campaign


@dataclass(frozen=True, eq=False)
class FittedCauses:
    """A set of causes fitted to a campaign.

    Args:
        names: names of the causes, in the order of their addition.
        chi2: sum of the squared residuals in noise variances.
        rows: number of residuals.
        numbers: number of parameters of the causes, including the parameters of single runs.
        fit: fit of the diagnosis.
    """

    names: tuple[str, ...]
    chi2: float
    rows: int
    numbers: int
    fit: Any

    @property
    def coefficients(self) -> dict[str, dict[str, float]]:
        """``cn_beta`` and ``cn_r`` with their standard deviations, 1/rad, where fitted."""
        have = [n for n in ("cn_beta", "cn_r") if n in self.fit.problem.names and self.fit.std(n) > 0.0]
        return {n: {"value": self.fit.value(n), "std": self.fit.std(n)} for n in have}

    def with_one_more(self, name: str) -> FittedCauses | None:
        """The fit with a further cause, in its textbook form; None where it cannot be fitted."""
        kind = {kind.name: kind for kind in KINDS}[name]
        found = one_more(self.fit, kind)
        return None if found is None else _fitted((*self.names, name), found)


def nominal(folder: Path) -> tuple[FittedCauses, tuple[str, ...], bool]:
    """The nominal model fitted to a campaign.

    Returns:
        The fit; causes detected in the records before any fit (hum and a coarse step); and whether a gap is
        detected.

    Raises:
        TunnelError: when the records are refused.
    """
    study = nominal_study(_campaign(folder), KINDS)
    return _fitted((), study.nominal), tuple(study.read_off), bool(study.gap.test.detected)


@dataclass(frozen=True, eq=False)
class Grown:
    """The sets of causes that `tunnel diagnose` fits to a campaign.

    Args:
        nominal: the nominal model fitted to the same readings.
        sets: fitted sets with sorted names; the better fit where names are equal.
        random: sets with a random moment: names, the other causes, and the decrease of −2 ln L by the moment.
        read_off: causes detected in the records before any fit.
        settled: the answer where no set is weighed (there is no gap, or the noise explains it); else None.
    """

    nominal: FittedCauses
    sets: tuple[FittedCauses, ...]
    random: tuple[tuple[tuple[str, ...], tuple[str, ...], float], ...]
    read_off: tuple[str, ...]
    settled: tuple[str, ...] | None


def grown(folder: Path) -> Grown:
    """All fits of `tunnel diagnose` to a campaign, before its own weights.

    Raises:
        TunnelError: when the records are refused.
    """
    study = investigate(_campaign(folder), KINDS)
    stated = [answer.stated for answer in study.answers if answer.stated is not None]
    sets = [one for one in stated if one.moment is None]
    settled = not sets or study.answers[0].probability == 1.0
    data = _most_common([h.fit.problem.data for h in sets]) or study.nominal.problem.data
    nominal = study.nominal if data is study.nominal.problem.data else fit_nominal(data)
    best: dict[tuple[str, ...], FittedCauses] = {}
    for h in sets:
        one = _fitted(h.names, h.fit)
        if h.fit.problem.data is data and (h.names not in best or one.chi2 < best[h.names].chi2):
            best[h.names] = one
    random = tuple(
        (one.names, tuple(sorted(one.effects)), one.moment.process.drop)
        for one in stated
        if one.moment is not None
    )
    return Grown(
        _fitted((), nominal),
        tuple(best.values()),
        random,
        tuple(study.read_off),
        study.causes if settled else None,
    )


def _most_common(given: Sequence[Data]) -> Data | None:
    """The readings used for the fits of most sets."""
    return max(given, key=lambda one: sum(other is one for other in given), default=None)


def _campaign(folder: Path) -> Campaign:
    campaign, _ = comparable_runs(diagnosable(read_campaign(folder)).campaign)
    return campaign


def candidates() -> tuple[str, ...]:
    """Causes that a fit can find."""
    return tuple(kind.name for kind in KINDS if kind.fitted)


def _fitted(names: tuple[str, ...], fit: Any) -> FittedCauses:
    problem, runs = fit.problem, len(fit.problem.data.runs)
    own = problem.parameters.of_effects
    return FittedCauses(names, fit.total, fit.count, len(problem.effect_names) + own * runs, fit)
