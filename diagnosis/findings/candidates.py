"""The answers considered: their probabilities and parameters, in numbers, tables and a figure."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Final

import numpy as np

from diagnosis.answer.held_out import Base
from diagnosis.answer.linear_theory import move_of_halves, parameter_shift
from diagnosis.answer.sizes_by_run import SizeByRun
from diagnosis.findings.closing import Closing
from diagnosis.findings.finding import Judged, Picture
from diagnosis.findings.repeatability import RunRepeatability
from diagnosis.findings.terms import answer_name, scattering
from diagnosis.findings.units import own_parameters
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import linear_coefficients
from diagnosis.search.answer import UNKNOWN, Answer
from diagnosis.search.prepared import COARSE_STEP, HUM
from diagnosis.search.random_spectra import LONGEST_BANDWIDTH
from diagnosis.search.rivals.two_springs import ONE_SPRING, SpringError
from diagnosis.search.study import Study
from diagnosis.settings import GapSettings
from identification.show.blocks import TextTable
from identification.show.drawing import ACCENT, NARROW, QUIET
from identification.show.numbers import (
    estimated,
    explained,
    held_out_excess,
    plain,
    probability,
    share,
    unit_mark,
)
from identification.show.quantity import Quantity
from identification.show.style import figure, grid, styled
from tunnel_sim.effects import BetweenRuns, known_effects
from tunnel_sim.effects.parameters import ParameterInfo
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.freedom import Freedom

if TYPE_CHECKING:
    from matplotlib.figure import Figure


UNDETERMINED_FROM: Final = 10.0
"""Maximum ratio of a parameter's standard deviation to its value and its typical size for it to be determined.
Judgement. Above it, even the order of magnitude is unknown."""


@dataclass(frozen=True)
class Candidate:
    """An answer that was considered.

    Args:
        effect: name, ``none`` or ``unknown``; several names are joined by a plus sign.
        probability: probability of the answer, a fraction.
        excess_after: excess in the fitted runs with the answer added, in units of the noise variance. Each
            instant and phase of a single run counts as 10 of χ².
        closed: share of the gap in the fitted runs that the answer explains.
        parameters: its fitted parameters by name (``effect.parameter`` where it has several effects).
    """

    effect: str
    probability: float
    excess_after: float
    closed: float
    parameters: Mapping[str, Quantity] = field(default_factory=dict)


def meant_parameter(found: Quantity, info: ParameterInfo, swing: float, undetermined: float) -> Quantity:
    """A fitted parameter, its standard deviation omitted where it is meaningless.

    Args:
        swing: largest angle of the motion, rad.
        undetermined: maximum standard deviation over value and usual size, a ratio; above it the parameter is
            meaningless.

    Returns:
        The estimate. It is not determined where its standard deviation exceeds a uniform distribution's over
        the allowed range, or this multiple of the parameter's value and usual size.
    """
    lower, upper = info.fit_range(swing)
    uniform = (upper - lower) / math.sqrt(12.0)
    size = undetermined * max(abs(found.value), info.scale)
    return _limited(found, min(uniform, size))


def meant_coefficient(estimate: Quantity, fit: Fit, name: str) -> Quantity:
    """A coefficient, its standard deviation omitted where it is meaningless.

    Args:
        name: ``cn_beta``, ``cn_r``, ``omega_n``, ``zeta`` or a parameter of a joint's law.

    Returns:
        The estimate. It is not determined where its standard deviation exceeds ωn itself, a damping ratio of 1,
        or the coefficient that in the fastest wind gives the moment of the spring or of critical damping.
    """
    if name == "omega_n":
        return _limited(estimate, abs(estimate.value))
    if name == "zeta":
        return _limited(estimate, 1.0)
    if not name.startswith("cn_"):
        return estimate
    data, greatest = fit.problem.data, math.inf
    for index, run in enumerate(data.runs):
        if pressure := data.air_moment(run):
            inertia, _, stiffness = linear_coefficients(fit, index)
            if name == "cn_beta":
                own = abs(stiffness) / pressure
            else:
                critical = 2.0 * math.sqrt(inertia * abs(stiffness))
                own = critical * run.wind_speed / (pressure * data.reference_length)
            greatest = min(greatest, own)
    return _limited(estimate, greatest)


def _limited(found: Quantity, greatest: float) -> Quantity:
    if found.std is None or 0.0 < found.std <= greatest:  # 0: the readings do not depend on the parameter
        return found
    return replace(found, std=None, determined=False)


_AT_LIMIT = 0.999  # share of the greatest bandwidth: a search that ends above it is at the bound


def candidates(study: Study, base: Base, errors: Mapping[str, float] = {}) -> tuple[Candidate, ...]:
    """The answers, with their residual gap in the fitted runs by the fits' own integrator.

    Args:
        errors: further standard deviations of the answer's parameters, not due to noise, by ``effect.parameter``,
            in their units.

    Returns:
        Answers, ``none`` and ``unknown`` among them: the answer first, then the most probable ones. Their
        probabilities sum to 1.
    """
    block, rate = study.nominal.problem.data.mean_block, study.settings.gap.detection_rate
    excess = study.nominal.excess / block
    if not study.causes:
        return (
            Candidate("none", 1.0 - rate, excess, 0.0),
            Candidate("unknown", rate, excess, 0.0),
        )
    answers = []
    before = max(study.nominal.excess, 1e-9)
    for answer in study.answers:
        if answer.effects == UNKNOWN:
            answers.append(Candidate("unknown", answer.probability, before / block, 0.0))
            continue
        name = " + ".join(sorted({*study.named_beside(answer), *answer.effects} or _scatter(study)))
        left, closed = answer.share * before / block, max(0.0, 1.0 - answer.share)
        answers.append(Candidate(name, answer.probability, left, closed, _parameters(study, answer, errors)))
    if not study.answers:
        whole = excess + base.hum + base.extra
        closed = float(np.clip(1.0 - max(excess, 0.0) / max(whole, 1e-9), 0.0, 1.0))
        name = " + ".join(study.read_off)
        even = study.settings.weighing.even_share
        answers.append(Candidate(name, 1.0 - even, excess, closed, _parameters(study)))
        answers.append(Candidate("unknown", even, whole, 0.0))
    none = 0.0 if study.beside else min(study.gap.test.p_value, rate)
    answers.append(Candidate("none", none, before / block, 0.0))
    total = sum(candidate.probability for candidate in answers)
    first, *others = (replace(c, probability=c.probability / total) for c in answers)
    return (first, *sorted(others, key=lambda c: -c.probability))


def _scatter(study: Study) -> set[str]:
    """The chance differences that the runs may have: the only explanation of a gap in an answer without effects."""
    data = study.nominal.problem.data
    return {kind.name for kind in known_effects() if issubclass(kind, BetweenRuns) and data.may_show(kind)}


def inclusion(
    answers: Sequence[Candidate], read_off: Sequence[str], chosen: GapSettings, freedom: Freedom
) -> dict[str, float]:
    """Probability that an effect is among the causes, for every effect of the vocabulary.

    Args:
        freedom: of the body, which may exclude effects.

    Returns:
        For each effect, the sum of the probabilities of the answers that name it. For a cause detected in the
        records: 1 minus the false-alarm rate of the test of the gap.
    """
    found = {
        kind.name: min(sum(c.probability for c in answers if kind.name in c.effect.split(" + ")), 1.0)
        for kind in known_effects()
        if kind.possible(freedom)
    }
    return found | dict.fromkeys(read_off, 1.0 - chosen.detection_rate)


def _parameters(
    study: Study, answer: Answer | None = None, errors: Mapping[str, float] = {}
) -> dict[str, Quantity]:
    """Parameters of the causes detected in the records, and of an answer; unprefixed for a single effect.

    Args:
        errors: as in `candidates`.
    """
    estimates: dict[str, Quantity] = {}
    prepared, hum = study.prepared, study.prepared.hum
    if hum is not None:
        amplitude, frequency = (f"{HUM.name}.{info.name}" for info in HUM.parameters())
        estimates[amplitude] = Quantity(hum.amplitude, hum.std, "rad")
        estimates[frequency] = Quantity(hum.frequency, hum.frequency_std, "Hz")
    if prepared.coarse:
        step = f"{COARSE_STEP.name}.{COARSE_STEP.parameters()[0].name}"
        estimates[step] = Quantity(prepared.step, None, "rad")
    moment = None if answer is None else answer.moment
    hypothesis = None if answer is None else answer.stated
    if hypothesis is not None:
        fit, problem = hypothesis.fit, hypothesis.fit.problem
        infos = {f"{kind.name}.{info.name}": info for kind in problem.effects for info in kind.parameters()}
        inflate = float(np.sqrt(1.0 + max(fit.excess, 0.0)))
        for name in problem.effect_names:
            bound = fit.bound(name)
            further = errors.get(name, 0.0) if fit is study.chosen else 0.0
            std = None if bound else math.hypot(fit.std(name) * inflate, further)
            given = Quantity(fit.value(name), std, infos[name].unit, bound=bound)
            estimates[name] = meant_parameter(given, infos[name], problem.data.swing, UNDETERMINED_FROM)
        for one in problem.scatter:
            if one.shown:
                spread = one.kind.parameters()[0]
                estimates[f"{one.name}.{spread.name}"] = Quantity(one.width, None, spread.unit)
        for name, value in problem.fixed:
            estimates[name] = Quantity(value, 0.0, infos[name].unit)
    if moment is not None:
        seconds = moment.process.interval * sum(i.size for i in moment.process.innovations)
        data = study.nominal.problem.data
        for kind in moment.kinds:
            parts = [one for one in moment.process.spectrum if one.is_of(kind)]
            part = max(parts, key=lambda one: one.intensity)
            intensity = float(np.sqrt(sum(one.intensity**2 for one in parts)))
            severity, place = (f"{kind.name}.{info.name}" for info in kind.parameters())
            # their spread follows from the number of correlation times in the runs
            independent = max(seconds * min(4.0 * part.bandwidth, 1.0 / moment.process.interval), 2.0)
            relative = float(np.sqrt(0.5 / independent))
            if part.strouhal_number > 0.0:
                size = float(np.sqrt(2.0)) * intensity
                speeds = [run.wind_speed for run in data.in_wind]
                reduced = float(np.sqrt(np.mean(np.square(speeds)))) / data.width  # Hz
                estimates[severity] = Quantity(size, size * relative, "1")
                estimates[place] = Quantity(part.strouhal_number, part.bandwidth / reduced * relative, "1")
            else:
                # above the rig's frequencies a random moment looks white: the runs show only size over square
                # root of the corner
                limit = "upper" if part.bandwidth >= _AT_LIMIT * LONGEST_BANDWIDTH else None
                size = float(np.hypot(intensity, np.linalg.norm([one.tail for one in parts])))
                std = float(
                    np.hypot(intensity * relative, size - intensity)
                )  # where a tail ends is not shown
                estimates[severity] = Quantity(size, std, kind.parameters()[0].unit)
                estimates[place] = Quantity(part.bandwidth, None, "Hz", bound=limit)
    own = own_parameters(estimates, study.campaign, study.similarity, study.model)
    single = len({name.split(".")[0] for name in own}) == 1
    return {name.split(".")[1] if single else name: value for name, value in own.items()}


def parameter_errors(study: Study, closes: Closing, sizes: Sequence[SizeByRun]) -> dict[str, float]:
    """Standard deviations of the answer's parameters by other sources than noise, by ``effect.parameter``.

    Args:
        sizes: sizes of the causes in every run (`study_sizes`).

    Returns:
        In the parameters' units of the similar campaign. One source is the change by MuJoCo's integrator, where
        it and the fits' integrator disagree. The other is the form of a cause, which is not exact where halves of
        the data (`move_of_halves`) or single runs (`SizeByRun.form_std`) differ by more than chance in its size.
    """
    fit = study.chosen
    problem = fit.problem
    if not study.named or fit is study.nominal:
        return {}
    stepped = np.zeros(len(problem.names))
    if not closes.confirmation.agrees and not closes.confirmation.failure:
        stepped = parameter_shift(fit, [closes.shifts[run.id] for run in problem.data.runs])
    by_run = {f"{one.effect}.{one.parameter}": one.form_std for one in sizes}
    found = {}
    for place, name in enumerate(problem.names):
        if name in problem.effect_names and fit.bound(name) is None:
            halves = move_of_halves(fit, np.eye(len(problem.names))[place])
            found[name] = math.hypot(float(stepped[place]), max(halves, by_run.get(name, 0.0)))
    return found


ANSWERS_LISTED: Final = 6
"""Maximum number of answers in a table. Judgement."""
ANSWER_LISTED: Final = 0.005
"""Minimum probability of an answer in a table. Judgement."""
ANSWER_DRAWN: Final = 0.01
"""Minimum probability of an answer in the charts of the report. Judgement."""


def ranked(candidates: Sequence[Candidate]) -> list[Candidate]:
    """The answers of a document, the most probable first.

    The document starts with its answer. In an undecided diagnosis this is the most probable set of effects,
    although an unknown cause may be more probable.
    """
    return sorted(candidates, key=lambda one: -one.probability)


def candidates_table(
    candidates: Sequence[Candidate], repeated: RunRepeatability, judged: Judged
) -> TextTable:
    """The answers considered and their shares of the gap, most probable first; a last row counts the others."""
    rows, given = [], ranked(candidates)
    probable = [c for c in given[:ANSWERS_LISTED] if c.probability >= ANSWER_LISTED]
    shown = probable or given[:1]
    for candidate in shown:
        fitted = candidate.effect not in ("none", "unknown")
        closed = share(candidate.closed) if fitted else "–"
        name = answer_name(candidate.effect).replace(" + ", " +\n")
        parameters = "\n".join(
            f"{plain(full).replace('.', ': ')} = {_estimate(repeated, full, candidate.effect, given)}"
            for full, given in candidate.parameters.items()
        )
        excess = held_out_excess(candidate.excess_after)
        rows.append((name, probability(candidate.probability), closed, excess, parameters))
    if others := given[len(shown) :]:
        together = sum(candidate.probability for candidate in others)
        rows.append((f"{len(others)} more, together", probability(together), "", "", ""))
    detail = ("residual [× noise variance]", "parameters")
    heads = ("answer", "probability", "explained in the fit", *detail)
    return TextTable(
        f"Answers for {judged.campaign}",
        heads,
        tuple(rows),
        heads[1:4],
        names=("answer",),
        detail=detail,
    )


def _estimate(repeated: RunRepeatability, full: str, candidate: str, given: Quantity) -> str:
    """A parameter of an answer, by its full name."""
    mark = unit_mark(beside(given.unit, ""))
    return repeated.spread_estimate(full.rpartition(".")[0] or candidate, given) or estimated(given, mark)


def parameters_table(
    first: Candidate, repeated: RunRepeatability, judged: Judged, choices: Sequence[SpringError] = ()
) -> TextTable:
    """The parameters of the answer; a table without rows where it has none.

    Args:
        choices: springs of which one is off where the runs cannot tell which; each has a row.
    """
    rows, effect = [], ""
    springs = {
        f"{ONE_SPRING.name}.error if {one.stiffness:g} N m/rad is off": Quantity(one.error, one.std, "1")
        for one in choices
    }
    fitted = {
        full: one
        for full, one in first.parameters.items()
        if not (springs and full.startswith(ONE_SPRING.name))
    }
    for full, given in {**fitted, **springs}.items():
        owner, _, name = full.partition(".") if "." in full else ("", "", full)
        owner = owner or first.effect
        size = _estimate(repeated, full, first.effect, given)
        rows.append((owner if owner != effect else "", name, size))
        effect = owner
    whose = "Parameters" if judged.decided else f"Parameters of the {judged.set_out}"
    units = explained({given.unit for given in first.parameters.values()})
    heads = ("effect", "parameter", "estimate")
    return TextTable(f"{whose} ± one standard deviation{units}", heads, tuple(rows), names=heads[:2])


def inclusion_line(inclusion: Mapping[str, float], least: float) -> str:
    """The effects that may be among the causes, most probable first; empty where none is probable enough.

    Args:
        inclusion: by effect, the probability that it is among the causes.
        least: probability of an effect that is listed.
    """
    likely = dict(sorted(inclusion.items(), key=lambda item: -item[1]))
    names = [name for name, value in likely.items() if value >= least]
    last = scattering(names)  # scatter is common to every answer
    ordered = [*(name for name in names if name not in last), *last]
    shown = [f"{plain(name)} {probability(likely[name])}" for name in ordered]
    return f"Among the causes, with probability: {', '.join(shown)}." if shown else ""


SHOWN = 8
"""Maximum number of answers in the figure."""


_LABEL = 24  # characters in a line of a label


def candidates_pictures(candidates: Sequence[Candidate]) -> tuple[Picture, ...]:
    """The likely answers."""
    drawn = Picture(
        "which",
        "Probability of the likely answers. The possible answers are: no gap, every fitted set of effects, and "
        "unknown.",
        "Bars: probability of each answer.",
        partial(candidates_figure, candidates),
    )
    return (drawn,)


@styled
def candidates_figure(candidates: Sequence[Candidate]) -> Figure | None:
    """The answers that are not improbable; None if there are fewer than two: words suffice."""
    shown = [c for c in ranked(candidates)[:SHOWN] if c.probability >= ANSWER_DRAWN]
    if len(shown) < 2:
        return None
    names = [textwrap.fill(plain(answer_name(candidate.effect)), _LABEL) for candidate in shown]
    fig = figure(NARROW, 0.7 + 0.3 * len(shown) + 0.15 * sum(name.count("\n") for name in names))
    axes = fig.add_subplot()
    values = [candidate.probability for candidate in shown]
    colours = [ACCENT if candidate is candidates[0] else QUIET for candidate in shown]
    axes.barh(range(len(shown)), values, color=colours, height=0.6)
    for index, value in enumerate(values):
        axes.text(value + 0.01, index, probability(value), va="center")
    axes.set_yticks(range(len(shown)), names)
    axes.invert_yaxis()
    axes.set(xlim=(0.0, 1.12), xticks=np.linspace(0.0, 1.0, 6), xlabel="probability")
    grid(axes, "x")
    return fig
