"""The answer in plain words: the verdict, caveats with their remedies, and what remains of the gap."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from scipy.special import chdtrc

from diagnosis.closure import Move, Remainder, of_swing, rms_shown
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import CHANNELS, misfit
from diagnosis.noise.gap import gap_test
from diagnosis.noise.kinds import Noise
from diagnosis.printing import Decision, noise_powers, part, plain, probability, share, undecided_words
from diagnosis.result import Confirmation, GapSummary, Hidden, ParameterEstimate, RunGap
from diagnosis.search.investigate import Study
from diagnosis.search.outside import ONE_SPRING, AnotherSpring
from diagnosis.search.weigh import UNKNOWN
from diagnosis.settings import Settings, WordsSettings
from identification.printing import COEFFICIENTS, significant, unit_mark, with_std
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign

Estimates = Mapping[str, ParameterEstimate]


def cautions(
    campaign: Campaign,
    noise: Noise,
    runs: Sequence[RunGap],
    confirmation: Confirmation,
    *,
    named: bool,
    settings: Settings,
) -> tuple[str, ...]:
    """The caveats of an answer.

    Args:
        runs: the gap by run, which says whether the run could be held out of the fit.
        confirmation: whether the fits' integrator agrees with the MuJoCo model.
        named: whether the answer names effects; only then are runs held out of a fit.
    """
    found, chosen = [], settings.words
    if len(campaign.runs) > 1 and all(run.spring_stiffness is None for run in campaign.runs):
        found.append(
            "No run states spring_stiffness, so all runs are assumed to have the same spring, and moments are "
            "per unit inertia. State it, or leave out the runs with another spring: a different spring looks like "
            "a gap."
        )
    std = noise.estimated**0.5
    ratio = std / noise.stated_variance**0.5 if noise.stated_variance else 1.0
    said = f"The records' noise is {ratio:.3g} times what noise_std and resolution state"
    if not noise.shown:
        found.append(
            f"The records contain almost no noise ({std:.1g} rad). The accuracy of the fits, "
            f"{noise.used**0.5:.1g} rad, stands in for it, and a smaller gap is not detected. Add sensor noise to "
            f"simulated records."
        )
    elif ratio <= 1.0 / chosen.noise_contradicted:
        found.append(
            f"{said}. The answer is based on the noise found in the records; correct noise_std or leave it out."
        )
    elif ratio >= chosen.noise_contradicted:
        found.append(
            f"{said}, and noise above the stated level counts as a gap. If the sensor really is as noisy as that, "
            f"correct noise_std or leave it out."
        )
    if confirmation.failure:
        found.append(
            f"The MuJoCo model could not follow the fitted motion ({confirmation.failure}), so all figures come "
            f"from the fits' own integrator. Do not rely on the fitted parameters."
        )
    elif not confirmation.agrees:
        tolerance = part(settings.answer.integrator_tolerance)
        found.append(
            f"The fits' own integrator differs from the MuJoCo model by {confirmation.rms_difference:.1e} rad "
            f"(root mean square over {confirmation.run}), more than {tolerance} of the noise "
            f"({confirmation.tolerance:.1e} rad). The gap before and after comes from MuJoCo. The parameters and "
            f"probabilities come from the fits, and may be wrong by as much."
        )
    windy = any(run.wind_on for run in campaign.runs)
    if len(campaign.runs) < chosen.runs_without_caution:
        motion, others = "decay", "with other springs and release angles"
        if campaign.driven:
            motion, others = "motion", "with other inputs"
        if windy:
            others = "with other springs, wind speeds and release angles"
        number = "is one run" if len(campaign.runs) == 1 else f"are {len(campaign.runs)} runs"
        found.append(
            f"There {number} only: causes are distinguished by the form of the {motion} alone. Add runs {others}."
        )
    fitted = [run.id for run in runs if not run.held_out]
    if named and len(fitted) == len(runs):
        found.append(
            "No run could be held out of the fit, so the share closed is that of the fitted runs. The gap as the "
            "causes are added is predicted for stretches of time left out. Repeat every "
            f"{'spring, with the wind off and on' if windy else 'run'}: a run left out tests more than a stretch."
        )
    elif named and fitted:
        found.append(
            f"Not held out of the fit, since no other run has the same spring or wind: {', '.join(fitted)}. "
            f"Their gap with the causes added is that of the fit; repeat these runs."
        )
    return tuple(found)


_CHANNEL_WORDS = {
    "stiffness": "the restoring moment",
    "damping": "the damping",
    "forcing": "an imposed moment",
    "sensor": "the angle sensor",
    "calibration": "a stated value",
}


def verdict(
    causes: Sequence[str],
    found: Decision,
    gap: GapSummary,
    *,
    rest: Remainder,
    both_winds: bool,
    beside: str = "",
    chosen: WordsSettings,
) -> str:
    """The answer in one paragraph.

    Args:
        both_winds: whether the campaign has runs with the wind off and runs with the wind on.
        beside: a sentence on what nearly explains the gap (`nearly_words`), or on what it matters
            (`immaterial_words`); empty: none.
    """
    if not causes:
        return (
            f"No gap: the nominal model explains the runs down to their noise "
            f"(mean squared residual over noise variance, minus one: {gap.excess_before:+.3f})."
        )
    excess = gap.excess_before
    size = f"{f'{excess:.2f}' if excess < 10.0 else significant(excess, 4)} times the noise power"
    if gap.misfit is not None:
        size = f"{rms_shown(gap.misfit, excess)} root mean square, {of_swing(gap.misfit, excess)}, {size}"
    if not found.decided:
        said = f"There is a gap ({size}), and its cause is undecided."
        with_first = f"With the first of them added, {share(gap.closed)} of the gap closes {gap.closed_on}."
        closed = () if tuple(causes) == UNKNOWN else (with_first,)
        return " ".join((said, undecided_words(found, chosen), *closed))
    if tuple(causes) == UNKNOWN:
        said = "no effect is named as its cause" if beside else "no effect of the vocabulary explains it"
        return " ".join(filter(None, (f"There is a gap ({size}), and {said}.", beside, rest.words)))
    several, sources = len(causes) > 1, []
    for name in causes:  # what each acts on and, where the campaign can show it, whether it needs the wind
        kind = effect_class(name)
        wind = (
            f", with the wind {'on' if kind.condition == 'wind_on' else 'on and off'}" if both_winds else ""
        )
        sources.append(f"{_CHANNEL_WORDS[kind.channel]}{wind}{f' ({plain(name)})' if several else ''}")
    return (
        f"The gap ({size}) comes {'only in part ' if rest.material else ''}"
        f"from {plain(*causes)} (probability {probability(found.credible[0][1])}): "
        f"{'; '.join(sources)}. With {'them' if several else 'it'} added, {share(gap.closed)} of the gap "
        f"closes {gap.closed_on}. {' '.join(filter(None, (rest.words, beside)))}"
    )


_IN_CHANNEL = {
    "damping": "the damping along the runs",
    "frequency": "the frequency along the runs",
    "damping of runs": "the damping of single runs",
    "frequency of runs": "the frequency of single runs",
    "zero": "the zero",
    "harmonics": "the harmonics",
}


def nearly_words(study: Study) -> str:
    """The effects that explain most of a gap without being named, and why they are not; empty where none do."""
    sets, chosen = [answer for answer in study.weighed if answer.effects != UNKNOWN], study.settings.words
    first = max(sets, key=lambda answer: (answer.probability, -answer.share), default=None)
    if study.causes != UNKNOWN or first is None or first.share > 1.0 - chosen.nearly_explains:
        return ""
    names = plain(*first.effects).capitalize()
    said = f"{names} would explain {share(1.0 - first.share)} of it"
    if study.test.noisy and first.probability == 0.0:
        return f"{said}, but the noise misbehaves and may be all of a gap as small as this."
    said = f"{said} (probability {probability(first.probability)})"
    alike = [a for a in sets if a is not first and a.share <= first.share + chosen.nearly_alike]
    rival = max(alike, key=lambda answer: answer.probability, default=None)
    if rival is not None and rival.probability >= chosen.nearly_rival * first.probability:
        return f"{said}, and {plain(*rival.effects)} as much ({probability(rival.probability)})."
    fitted = study.hypothesis(first.effects)
    if fitted is not None:
        chance = chosen.nearly_misfit_stds * np.sqrt(2.0 * misfit(study.nominal).count)
        left = [
            _IN_CHANNEL[name] for name, x, c in zip(CHANNELS, fitted.excess, chance, strict=True) if x > c
        ]
        if left:
            return f"{said}, but leaves a significant misfit of {' and '.join(left)}."
    return f"{said}: too little to name it."


def immaterial_words(before: Estimates, after: Estimates, chosen: WordsSettings) -> str:
    """That the causes change no coefficient materially, in a sentence; empty where they do."""
    known = {name: given for name, given in after.items() if given.std and given.value and name in before}
    moves = {name: abs(given.value - before[name].value) for name, given in known.items()}
    limits = {
        name: min(chosen.immaterial * abs(given.value), given.std or 0.0) for name, given in known.items()
    }
    if not known or any(moves[name] > limit for name, limit in limits.items()):
        return ""

    def size(name: str) -> str:
        return f"less than {_rounded_up(100.0 * moves[name] / abs(known[name].value))} %"

    return f"The gap is immaterial: its causes change {_each(list(known), size)}."


def spring_words(study: Study) -> tuple[str, ...]:
    """The likeliest pair of springs that are off, in a sentence; none where none closes most of the gap."""
    best = min(study.outside, key=lambda pair: pair.fit.total, default=None)
    if (
        best is None
        or best.fit.excess > (1.0 - study.settings.words.two_springs_explain) * study.nominal.excess
    ):
        return ()
    chosen, inflate = dict(best.fit.problem.fixed), float(np.sqrt(1.0 + max(best.fit.excess, 0.0)))
    springs = []
    for name in (ONE_SPRING.name, AnotherSpring.name):
        stated = chosen[f"{name}.{ONE_SPRING.chosen_spring()}"]
        springs.append(_spring_error(study, best.fit, name, stated, inflate))
    beside = [name for name in best.names if name not in (ONE_SPRING.name, AnotherSpring.name)]
    others = f" beside {plain(*beside)}" if beside else ""
    return (
        f"Two springs that are not as stiff as stated would explain the gap{others}, such as "
        f"{' and '.join(springs)}: measure their stiffness again.",
    )


def choice_words(study: Study) -> tuple[str, ...]:
    """Which of the springs may be off, in a sentence, where the runs cannot tell; else none."""
    found = []
    for choice in study.choices.get(study.fitted, ()):
        fit = choice.hypothesis.fit
        inflate = float(np.sqrt(1.0 + max(fit.excess, 0.0)))
        stated = dict(fit.problem.fixed)[f"{ONE_SPRING.name}.{ONE_SPRING.chosen_spring()}"]
        off = _spring_error(study, fit, ONE_SPRING.name, stated, inflate)
        found.append(f"{off} ({probability(choice.probability)})")
    if not found:
        return ()
    return (
        f"These runs cannot tell which spring is off: {' or '.join(found)}. The coefficients are averaged over "
        "these choices: add runs with a third spring, or measure the stiffness of the springs again.",
    )


def _spring_error(study: Study, fit: Fit, name: str, stated: float, inflate: float) -> str:
    """A spring and its error, such as ``16.12 N m/rad by −1.96 ± 0.01 %``."""
    stiffness = study.similarity.own(stated, "N m/rad")
    error, std = (100.0 * of(f"{name}.error") for of in (fit.value, fit.std))
    return f"{stiffness:.4g} N m/rad by {'+' if error > 0.0 else ''}{with_std(error, inflate * std)} %"


def remainder(
    study: Study, stated: Estimates, moved: Mapping[str, float], excess: float, hidden: Sequence[Hidden] = ()
) -> Remainder:
    """Judge what the answer leaves of the gap; what chance explains is never material.

    The tests of bands do not see what coloured noise takes up. A further effect that is significant shows it.

    Args:
        stated: the coefficients of the answer's fit with their standard deviations.
        moved: by the same names, how far what remains moves them (`coefficient_move`), in their units.
        excess: left on readings held out of the fit, in noise variances of a sample.
        hidden: the effects that could hide beside the answer.
    """
    random, chosen = study.random_answer(study.fitted), study.settings.answer
    if random is not None:  # in its wind it leaves innovations
        runs = zip(study.chosen.problem.data.runs, study.chosen.residuals, strict=True)
        still = [residual for run, residual in runs if not run.wind_on]
        both = np.concatenate([*random.process.innovations, *still])
        p_value = float(chdtrc(both.size, both @ both))
    elif study.chosen is study.nominal:
        p_value = study.test.p_value
    else:  # no cause changes the tests of the noise itself: those of the residuals count
        noise = study.noise.rounded(study.chosen, study.step)
        p_value = gap_test(study.chosen, noise, study.trend, coarse_step=True).p_value
    further = max(hidden, key=lambda one: one.significance, default=None) if study.named else None
    by_effect = 1.0 if further is None else min(1.0, len(hidden) * float(chdtrc(1, further.significance**2)))
    shown = further is not None and by_effect < chosen.remains_rate <= p_value
    p_value = min(p_value, by_effect)
    beyond_chance = p_value < chosen.remains_rate
    moves, material = {}, []
    for name, given in stated.items():
        relative = moved[name] / abs(given.value) if given.value else None
        moves[name] = Move(moved[name], relative, given.std, given.unit)
        # by its standard deviation, or by a share, where the runs determine it
        least = chosen.material_share
        far = given.std is not None and (moved[name] > given.std or (relative or 0.0) > least)
        material += [name] if beyond_chance and far else []
    left = f"what remains ({noise_powers(excess)})" if study.named else "it"
    known = [name for name, move in moves.items() if move.std is not None]
    if not study.causes:
        words = "No gap: nothing remains beyond the noise."
    elif not beyond_chance:
        words = f"Explained; {left} is within the noise."
    elif material:
        moved_words = _each(material, lambda name: _sized(moves[name].value, stated[name]))
        start = f"Not all is explained: {left}" if study.named else "It"
        words = f"{start} could move {moved_words}. Do not trust the coefficients beyond the intervals given."
    elif not known:
        start = f"Explained; {left}" if study.named else "It"
        words = f"{start} concerns no coefficient that these runs determine."
    else:
        bounds = _each(
            known,
            lambda name: f"less than {_sized(max(moves[name].value, moves[name].std or 0.0), stated[name])}",
        )
        words = (
            f"Explained; {left} moves {bounds}." if study.named else f"It hardly matters: it moves {bounds}."
        )
    if shown and further is not None:
        words += f" {plain(further.effect).capitalize()} is significant beside it and too small to be named."
    return Remainder(beyond_chance, excess, p_value, bool(material), moves, words)


def _each(names: list[str], size: Callable[[str], str]) -> str:
    return " and ".join(f"{COEFFICIENTS.get(name, name)} by {size(name)}" for name in names)


def _sized(size: float, given: ParameterEstimate) -> str:
    """A change of a coefficient as its share, rounded up; in its unit where the coefficient itself is uncertain."""
    if given.std is not None and given.std < abs(given.value):
        return f"{_rounded_up(100.0 * size / abs(given.value))} %"
    return f"{_rounded_up(size)} {'' if given.unit == '1' else unit_mark(given.unit)}".strip()


def _rounded_up(value: float) -> str:
    """Two significant digits, never below the value."""
    if value <= 0.0:
        return "0"
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return f"{math.ceil(value / unit - 1e-9) * unit:.2g}"
