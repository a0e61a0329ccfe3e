"""Judgements on an answer: caveats, near explanations of the gap, springs that may be off, and the remainder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.special import chdtrc

from diagnosis.findings.closing import INTEGRATOR_TOLERANCE
from diagnosis.findings.closure import Confirmation, RunGap
from diagnosis.findings.terms import MISFITS
from diagnosis.likelihood.residuals import CHANNELS, misfit
from diagnosis.model.fact import Fact
from diagnosis.noise.kinds import Noise
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.study import Study
from identification.show.numbers import listed, plain, probability, relative_change, share
from identification.show.quantity import Quantity
from tunnel_sim.vocabulary.campaign import Campaign

RUNS_WITHOUT_CAUTION: Final = 3
"""Number of runs below which a caveat is given. Judgement."""
NOISE_CONTRADICTED: Final = 3.0
"""Error factor of the stated noise above which a caution is given. Judgement. Rounding to one digit can cause
half of it."""
SAME_RELEASE: Final = 1.1
"""Maximum ratio of the largest to the smallest swing of runs of one release amplitude. Judgement. Releases by
hand to one mark scatter by a few per cent."""
NEARLY_EXPLAINS: Final = 0.8
"""Minimum share of an unexplained gap that effects must explain to be mentioned. Judgement."""
NEARLY_ALIKE: Final = 0.02
"""Maximum difference of the shares that two rivals explain for both to count as equal. Judgement."""
NEARLY_RIVAL: Final = 0.5
"""Minimum probability of such a rival, relative to the mentioned effects, for it to be the reason that none is
named. Judgement."""
NEARLY_MISFIT_STDS: Final = 2.0
"""Margin of a channel's χ² over its expectation above which the channel's misfit is the reason that no effect
is named, in standard deviations. Convention."""
IMMATERIAL: Final = 0.01
"""Maximum relative change of the coefficients by an immaterial gap. Convention. Derivatives are quoted to one
per cent."""
ZEROS_CLOSE: Final = 0.5
"""Minimum share of an unexplained gap that a free zero in every run must explain to be mentioned. Convention.
Most of the gap."""


@dataclass(frozen=True)
class Nearly:
    """Effects that explain most of a gap but are not named.

    Args:
        closes: share of the gap in the fitted runs, a fraction.
        probability: probability of the effects being the answer, a fraction.
        noisy: whether the gap may be irregular noise alone.
        rival: effects that explain as much; empty if there are none.
        rival_probability: probability of the rival, a fraction.
        misfit: channels with a significant misfit.
    """

    effects: tuple[str, ...]
    closes: float
    probability: float
    noisy: bool = False
    rival: tuple[str, ...] = ()
    rival_probability: float = 0.0
    misfit: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """The effects that explain most of a gap but are not named, and the reason."""
        said = f"{plain(*self.effects).capitalize()} would explain {share(self.closes)} of the gap"
        if self.noisy:
            return f"{said}, but irregular noise may explain a gap this small."
        said = f"{said} (probability {probability(self.probability)})"
        if self.rival:
            explain = "explain" if len(self.rival) > 1 else "explains"
            rival = f"{plain(*self.rival)} {explain} as much ({probability(self.rival_probability)})"
            return f"{said}, and {rival}."
        if self.misfit:
            leave = "leave" if len(self.effects) > 1 else "leaves"
            return f"{said}, but {leave} a significant misfit of {listed([MISFITS[name] for name in self.misfit])}."
        return f"{said}, which is too little to name {'them' if len(self.effects) > 1 else 'it'}."


Estimates = Mapping[str, Quantity]


def cautions(
    campaign: Campaign,
    noise: Noise,
    runs: Sequence[RunGap],
    confirmation: Confirmation,
    *,
    named: bool,
    decays: bool = True,
) -> tuple[Fact, ...]:
    """The caveats of an answer.

    Args:
        decays: whether any run is a decay, from which causes are sought.
        runs: the gap by run, and whether the run could be held out of the fit.
        confirmation: whether the fits' integrator agrees with the MuJoCo model.
        named: whether the answer names effects; only then are runs held out of a fit.
    """
    facts = []
    if len(campaign.runs) > 1 and all(run.spring_stiffness is None for run in campaign.runs):
        facts.append(Fact("one spring assumed"))
    facts += noise.cautions(NOISE_CONTRADICTED)
    if confirmation.failure:
        facts.append(Fact("not followed", {"failure": confirmation.failure}))
    elif not confirmation.agrees:
        figures = {"rms_rad": confirmation.rms_difference, "tolerance_rad": confirmation.tolerance}
        beside = {"run": confirmation.run, "tolerance": INTEGRATOR_TOLERANCE}
        facts.append(Fact("not confirmed", figures | beside))
    windy = bool(campaign.in_wind)
    if decays and len(campaign.runs) < RUNS_WITHOUT_CAUTION:
        kind = {"driven": campaign.driven, "windy": windy}
        facts.append(Fact("few runs", {"runs": len(campaign.runs), **kind}))
    fitted = [run.id for run in runs if not run.held_out]
    if named and len(fitted) == len(runs):
        facts.append(Fact("none held out", {"windy": windy}))
    elif named and fitted:
        facts.append(Fact("some not held out", {"runs": fitted}))
    return tuple(facts)


def outside_the_fits(study: Study) -> tuple[Fact, ...]:
    """The parts of the records that no fit uses, and the effects that the runs do not confirm."""
    refused = list(study.refused.values())
    alone = {name: run for name, run in study.single.items() if name in study.fitted}
    single = {
        run: tuple(name for name in alone if alone[name] == run) for run in dict.fromkeys(alone.values())
    }
    return (
        *((Fact("cut"),) if study.prepared.cut else ()),
        *one_amplitude(study),
        *((Fact("needless", {"effects": study.needless}),) if study.needless else ()),
        *(Fact("only one run", {"effects": names, "run": run}) for run, names in single.items()),
        *(fact for place, fact in enumerate(refused) if fact not in refused[:place]),
        *((Fact("rested", {"runs": study.prepared.rested}),) if study.prepared.rested else ()),
    )


def one_amplitude(study: Study) -> tuple[Fact, ...]:
    """The fact that all runs have one release amplitude while forms are free; empty without free forms."""
    problem = study.chosen.problem
    runs, names = problem.data.runs, problem.free_forms
    if problem.data.driven or not names or not study.named:
        return ()
    conditions = {(run.spring_stiffness, run.wind_speed) for run in runs}
    releases = [float(np.max(np.abs(run.reading - np.median(run.reading)))) for run in runs]
    if len(conditions) > 1 or max(releases) > SAME_RELEASE * min(releases):
        return ()
    return (Fact("one amplitude", {"parameters": names}),)


def zeros_apart(study: Study) -> tuple[Fact, ...]:
    """The fact that a free zero in every run would explain most of an unexplained gap; empty where it would not."""
    nominal, chosen = study.nominal, study.settings.words
    if nominal.problem.data.model.own_zeros or study.campaign.sensor.zero == "common":
        return ()
    # a free zero removes exactly the mean of a run
    means = np.array([float(left.sum()) ** 2 / left.size for left in nominal.residuals])
    whole = float(sum(left @ left - left.size for left in nominal.residuals))
    by_chance = float(chdtrc(means.size, means.sum()))
    share = float(means.sum() - means.size) / whole if whole > 0.0 else 0.0
    if len(means) < 2 or by_chance >= chosen.zeros_rate or share < ZEROS_CLOSE:
        return ()
    return (Fact("zeros apart", {"share": min(share, 1.0)}),)


def nearly(study: Study) -> Nearly | None:
    """The effects that explain most of a gap but are not named; None if there are none."""
    sets = [answer for answer in study.answers if answer.effects not in ((), UNKNOWN)]
    first = max(sets, key=lambda answer: (answer.probability, -answer.share), default=None)
    if study.causes != UNKNOWN or first is None or first.share > 1.0 - NEARLY_EXPLAINS:
        return None
    found = Nearly(first.effects, 1.0 - first.share, first.probability)
    if study.gap.test.noisy and first.probability == 0.0:
        return replace(found, noisy=True)
    alike = [a for a in sets if a is not first and a.share <= first.share + NEARLY_ALIKE]
    rival = max(alike, key=lambda answer: answer.probability, default=None)
    if rival is not None and rival.probability >= NEARLY_RIVAL * first.probability:
        return replace(found, rival=rival.effects, rival_probability=rival.probability)
    fitted = first.hypothesis
    if fitted is None or fitted.moment is not None:
        return found
    chance = NEARLY_MISFIT_STDS * np.sqrt(2.0 * misfit(study.nominal).count)
    left = [name for name, x, c in zip(CHANNELS, fitted.excess, chance, strict=True) if x > c]
    return replace(found, misfit=tuple(left))


def immaterial(before: Estimates, after: Estimates) -> dict[str, float]:
    """By coefficient, the relative change by the causes; empty where any change is material."""
    known = {name: given for name, given in after.items() if given.std and given.value and name in before}
    moves = {name: abs(given.value - before[name].value) for name, given in known.items()}
    limits = {name: min(IMMATERIAL * abs(given.value), given.std or 0.0) for name, given in known.items()}
    if any(moves[name] > limit for name, limit in limits.items()):
        return {}
    return {name: abs(relative_change(before[name].value, given.value)) for name, given in known.items()}
