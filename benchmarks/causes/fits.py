"""The project's own fits, for methods that choose causes otherwise: the only file here that knows how "
"they are made."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from diagnosis.answer.held_out import one_more
from diagnosis.diagnosable import comparable_runs, diagnosable
from diagnosis.search.investigate import nominal_study
from tunnel_sim.effects import known_effects
from tunnel_sim.files.campaign_folder import read_campaign


@dataclass(frozen=True, eq=False)
class Fitted:
    """A set of causes fitted to a campaign.

    Args:
        names: of the causes, in the order they were added.
        chi2: sum of the squared residuals in noise variances.
        rows: number of residuals.
        numbers: number of parameters of the causes, those of every run included.
        fit: of the diagnosis.
    """

    names: tuple[str, ...]
    chi2: float
    rows: int
    numbers: int
    fit: Any

    @property
    def coefficients(self) -> dict[str, dict[str, float]]:
        """``cn_beta`` and ``cn_r`` with their standard deviations, 1/rad, where they are fitted."""
        have = [n for n in ("cn_beta", "cn_r") if n in self.fit.problem.names and self.fit.std(n) > 0.0]
        return {n: {"value": self.fit.value(n), "std": self.fit.std(n)} for n in have}

    def with_one_more(self, name: str) -> Fitted | None:
        """The fit with another cause, in its textbook form; None where it cannot be fitted.

        Args:
            name: of the cause.
        """
        kind = {kind.name: kind for kind in known_effects()}[name]
        found = one_more(self.fit, kind)
        return None if found is None else _fitted((*self.names, name), found)


def nominal(folder: Path) -> tuple[Fitted, tuple[str, ...], bool]:
    """The nominal model fitted to a campaign.

    Args:
        folder: of the campaign.

    Returns:
        The fit; causes that are read off the records before any fit (hum and a coarse step); and whether the
        test of the gap finds one.

    Raises:
        TunnelError: when the records are refused.
    """
    campaign, _ = comparable_runs(diagnosable(read_campaign(folder)).campaign)
    study = nominal_study(campaign, known_effects())
    return _fitted((), study.nominal), tuple(study.read_off), bool(study.test.detected)


def candidates() -> tuple[str, ...]:
    """Causes that a fit can find."""
    return tuple(kind.name for kind in known_effects() if kind.fitted)


def _fitted(names: tuple[str, ...], fit: Any) -> Fitted:
    problem, runs = fit.problem, len(fit.problem.data.runs)
    own = fit.point.release.shape[1] - problem.first_phase
    return Fitted(
        names, fit.total, fit.count, len(problem.names) - len(problem.nominal_names) + own * runs, fit
    )
