"""The next steps for the rig, each with its expected gain, the greatest gain first."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from diagnosis.findings.closure import shares_of_gap
from diagnosis.findings.coefficients import UNCERTAIN_FROM
from diagnosis.findings.disturbed_runs import disturbed_step
from diagnosis.findings.finding import NextStep
from diagnosis.findings.next_run import OTHER_INPUT, OTHER_SPEED, NextRun, source_of_width
from diagnosis.findings.patch import model_steps
from diagnosis.findings.place import runs_of_the_gap
from diagnosis.findings.repeatability import width_text
from diagnosis.findings.spring_choices import choice_steps
from diagnosis.findings.terms import CHANNELS, CONDITIONS, SCATTERS, without_scatter
from diagnosis.findings.whole import Findings
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.scatter import FEWEST_COMPARED
from identification.printing import COEFFICIENTS
from identification.show.numbers import listed, plain, relative_change, share, within
from identification.show.quantity import Quantity
from identification.status import Outcome, Remark
from tunnel_sim.effects import known_effects
from tunnel_sim.vocabulary.errors import counted


def next_steps(answer: Findings) -> list[str]:
    """The next steps, in order."""
    return [step.words for step in steps(answer)]


def steps(answer: Findings) -> list[NextStep]:
    """The next steps: the causes by their shares of the gap, then runs that narrow the answer and the coefficients.

    Without a cause to act on, the remedies for runs that are not used come first.
    """
    causes, decided = answer.causes, answer.decided
    runs = [*map(disturbed_step, answer.disturbed), *_remedies(answer.remarks)]
    runs += answer.repeated.steps(answer)
    if not causes and any(remark.withholds for remark in answer.remarks):
        return [*runs, NextStep("Diagnose again", "no coefficients are given until then")]
    if not causes:
        runs += model_steps(answer.model, answer)
        return [*runs, *_using(answer), *_narrowing(answer)] or [_NOTHING]
    if answer.cycling:
        return runs or [
            NextStep(
                "Record a free decay at a lower wind speed", "a growth or a limit cycle shows no derivative"
            )
        ]
    if not decided:
        return [*_deciding(answer), *runs, *model_steps(answer.model, answer), _NO_REPAIR]
    if causes == UNKNOWN:
        outside = list(_from_outside(answer))
        first = [*(outside or answer.repeated.pattern_steps), _look(answer)]
        return [*first, *runs, *model_steps(answer.model, answer), *_narrowing(answer)]
    meanwhile = NextStep("Until then use the coefficients with the causes, not those without")
    last = [NextStep("Do not trust the coefficients beyond their intervals", "the residual gap changes them")]
    return [
        *_mending(answer),
        *runs,
        *model_steps(answer.model, answer),
        *_narrowing(answer),
        NextStep("Then measure again", _expected(answer)),
        *([meanwhile] if answer.coefficients.after else []),
        *(last if answer.rest_is_material else []),
    ]


_NOTHING = NextStep("Leave the rig as it is", "the model agrees with the runs")
_NO_REPAIR = NextStep(
    "Do not repair the rig on this answer, and do not rely on the coefficients of any one cause"
)


def _using(answer: Findings) -> Iterator[NextStep]:
    """The use of coefficients without a cause; too few runs do not show whether their intervals are wide enough."""
    after = answer.coefficients.after
    if not after:
        return
    if len(answer.gap.runs) >= FEWEST_COMPARED or any(one.shares.get("scatter") for one in after.values()):
        yield NextStep("Use the coefficients as they are, within their intervals", "they need no correction")
        return
    yield NextStep("Repeat every run, at the same settings", "shows whether the runs repeat")
    yield NextStep("Until then use the coefficients with care", "their intervals assume that the runs repeat")


# ---- causes


def _mending(answer: Findings) -> Iterator[NextStep]:
    """Remedies of the causes, and runs that separate open causes, the largest share of the gap first."""
    parts = shares_of_gap(answer.waterfall)
    of_spring = {kind.name for kind in known_effects() if kind.chosen_spring()}
    certain = answer.named_causes.certain_and_open()[0] if answer.ambiguous_with else answer.causes
    names = [name for name in answer.causes if name not in of_spring or not answer.found.choices]
    found = []
    for name in (name for name in names if name in certain or name in SCATTERS):
        step = answer.repeated.pattern_step(name) or NextStep(
            answer.named_causes.advice(name), _gain(answer, name, parts)
        )
        found.append((name in SCATTERS, _part(parts, [name]), step))
    open_ones = [name for name in answer.causes if name not in certain and name not in SCATTERS]
    told_apart = open_ones or [name for name in answer.causes if name not in names] or names
    found += [(False, _part(parts, told_apart), step) for step in _telling_apart(answer)]
    later = [name for name in names if name in open_ones]
    found += [
        (False, -1.0, NextStep(answer.named_causes.advice(name), "if it is this one")) for name in later
    ]
    yield from (one.step for one in answer.found.readings)
    for _, _, step in sorted(found, key=lambda one: (one[0], -one[1])):
        yield step


def _part(parts: dict[str, tuple[float, str]], names: Sequence[str]) -> float:
    """The share of the gap that several causes explain."""
    return sum(parts[name][0] for name in names if name in parts)


def _gain(answer: Findings, name: str, parts: dict[str, tuple[float, str]]) -> str:
    """The gain from removing a cause; empty where it is not known."""
    if name in SCATTERS:
        spread = next((one for one in answer.repeated.spreads if one.effect == name), None)
        width = "" if spread is None else f"; now they scatter by {width_text(spread)}"
        return f"the runs then repeat in {_REPEATED[SCATTERS[name]]}{width}"
    if name not in parts:
        return ""
    part, beside = parts[name]
    whole = part > 0.9995 and not answer.rest_is_significant
    gap = f"{'the whole gap' if whole else f'{share(max(part, 1e-9))} of the gap'}{beside}"
    alone = len(without_scatter(answer.causes)) == 1
    return f"removes {gap}{_corrects(answer) if alone else ''}"


_REPEATED = {
    "wind_speed": "wind speed",
    "spring_stiffness": "stiffness",
    "mechanical_damping": "mechanical damping",
}


def _corrects(answer: Findings) -> str:
    """The changes of the coefficients by the only cause, if they are at least a per cent, after a blank."""
    given, found = answer.coefficients, []
    for name, one in given.before.items():
        two = given.comparable.get(name)
        if two is None or not (one.determined and two.determined) or one.value * two.value <= 0.0:
            continue
        if two.std is not None and two.std > UNCERTAIN_FROM * abs(two.value):
            continue
        change = abs(relative_change(one.value, two.value))
        if _VISIBLE <= change < 1.0 and not two.agrees(one.value):
            found.append(f"{COEFFICIENTS.get(name, name)} by {100.0 * change:.0f} %")
    return f" and corrects {listed(found)}" if found else ""


_VISIBLE = 0.01  # share of a coefficient: a smaller change is not mentioned


def _expected(answer: Findings) -> str:
    """The expected result of the next diagnosis."""
    gap = answer.gap
    before, after = (gap.misfit.words(value) for value in (gap.excess_before, gap.excess_after))
    if answer.rest is None or not answer.rest_is_significant:
        after = "nothing beyond the noise"
    return f"the misfit should fall from {before} to {after}"


# ---- answers that are not decided


def run_to_make(answer: Findings) -> NextRun | None:
    """The run that distinguishes the answers; None if no run is proposed, or the best one would not."""
    run = answer.next_run
    return run if run is not None and run.distinguishes() else None


def unplannable(answer: Findings) -> str:
    """The reason why no run can be planned from these runs, in a sentence; empty where one can."""
    known = answer.coefficients.before
    if answer.found.driven:
        return f"No run is planned for driven runs: {OTHER_INPUT}."
    if answer.cycling:
        return "No run can be planned: no run is a free decay."
    if any(remark.withholds for remark in answer.remarks):
        return "No run can be planned before the stated values are corrected."
    if "omega_n" in known:
        return "No run can be planned, because no spring is stated: state spring_stiffness for every run."
    return ""


def rival_lines(answer: Findings) -> list[str]:
    """Effects that the runs cannot distinguish from the causes, and the run that could; none without a rival."""
    decided = answer.decided
    rivals, run = answer.ambiguous_with if decided else (), answer.next_run
    lines = []
    certain = answer.named_causes.certain_and_open()[0] if rivals else answer.causes
    if rivals:
        lines.append(f"These runs cannot distinguish it from {' or '.join(map(plain, rivals))}.")
    if run is not None and run_to_make(answer) is None:
        lines.append(run.too_close())
    elif run is not None:
        which = (
            "A run that would distinguish them"
            if decided
            else "A run that would distinguish the likely answers"
        )
        lines.append(f"{which}: {run.words(answer.freedom, robot=answer.found.robot)}.")
    elif rivals and answer.found.driven:
        open_ones = {*answer.causes, *rivals} - set(certain)
        apart = {kind.condition for kind in known_effects() if kind.name in open_ones}
        lines.append(f"To distinguish them, {OTHER_INPUT if apart != {'wind_on'} else OTHER_SPEED}.")
    elif rivals and unplannable(answer):
        lines.append(
            "A run that would distinguish them cannot be computed: state every spring_stiffness, or add runs."
        )
    elif rivals:
        lines.append(
            "The springs, wind speeds and release angles of this campaign do not distinguish them: add others."
        )
    return lines


def _telling_apart(answer: Findings) -> Iterator[NextStep]:
    """Steps that separate the alternatives of a decided answer."""
    gain = _narrower(answer)
    run = run_to_make(answer)
    if run is not None and answer.ambiguous_with:
        yield NextStep(
            f"Make one more run: {run.conditions(answer.freedom, robot=answer.found.robot)}",
            f"settles which it is{gain}",
        )
    yield from choice_steps(answer.found.choices)


def _deciding(answer: Findings) -> Iterator[NextStep]:
    """Steps that decide between the likely answers."""
    if answer.decision.in_doubt("elsewhere"):
        runs = runs_of_the_gap(answer.where, answer.found.place)
        yield NextStep(
            f"Look at {runs} where the residuals point (Where), before any cause",
            "the likeliest cause acts elsewhere",
        )
    if answer.decision.in_doubt("pattern"):
        yield from answer.repeated.pattern_steps
    if answer.decision.in_doubt("scatter"):
        yield NextStep(
            "If the rig is known to repeat no better, state [repeatability], and diagnose again; else look for "
            "what changes from run to run, such as adapters and clamps",
            "the runs differ by more than is usual",
        )
    run, robot = run_to_make(answer), answer.found.robot
    if run is not None:
        yield NextStep(
            f"Make one more run: {run.conditions(answer.freedom, robot=robot)}",
            f"decides between the likely answers{_narrower(answer)}",
        )
        return
    # a stiffness that is stated and can be chosen
    springs = not robot and not unplannable(answer) and answer.model is None
    kinds = ["springs"] * springs + ["wind speeds"] * answer.windy
    kinds += ["inputs" if answer.found.driven else "release angles"]
    yield NextStep(f"Add runs with other {plain(*kinds)}", "these runs leave the answer undecided")


def _from_outside(answer: Findings) -> Iterator[NextStep]:
    """What to do about causes from outside the vocabulary that would explain the gap."""
    for rival in answer.found.rivals:
        if remedy := rival.figures.get("remedy"):
            yield NextStep(str(remedy), "a cause that is not in the vocabulary would explain the gap")


def _look(answer: Findings) -> NextStep:
    """The place in which to look for an unknown cause."""
    runs, place, channel = answer.where.runs, answer.found.place, answer.where.channel
    named = f", in {listed(list(runs))}" if place is not None and 0 < len(runs) < min(place.runs, 6) else ""
    what = "the rig" if channel is None else f"what acts on {CHANNELS[channel]}"
    wind = f" {CONDITIONS['wind_on']}" if answer.where.condition == "wind_on" else ""
    misfit, excess = answer.misfit, answer.gap.excess_before
    size = f"the cause makes a misfit of {misfit.words(excess)}" if misfit.shows(excess) else ""
    return NextStep(f"Examine {what}{wind}{named}, where the model departs from the runs", size)


# ---- runs, the model and intervals


def _remedies(remarks: Sequence[Remark]) -> list[NextStep]:
    """Remedies for runs that are left out or refused, or have wrong units, each listed once.

    A cut run is used and needs no remedy.
    """
    runs: dict[str, list[str]] = {}
    for remark in remarks:
        if remark.outcome in (Outcome.LEFT_OUT, Outcome.REFUSED) or remark.withholds:
            runs.setdefault(remark.remedy, []).extend(remark.runs)
    return [NextStep(f"{', '.join(names) or 'The campaign'}: {remedy}") for remedy, names in runs.items()]


def _narrowing(answer: Findings) -> Iterator[NextStep]:
    """For each source of a wide interval, the step that narrows it, and the resulting interval."""
    runs, found = answer.further_runs, dict[str, list[str]]()
    for name, one in answer.coefficients.comparable.items():
        source = source_of_width(name, one)
        if source in _NARROWS:
            part = _CUT.get(source, 1.0)
            if source == "noise" and runs is not None:
                part = 1.0 - runs.left.get(name, 1.0) ** 2
            if part > 0.0 and (becomes := _becomes(name, one, part * one.shares[source])):
                found.setdefault(source, []).append(becomes)
    for source, gains in found.items():
        what = _NARROWS[source].format(other="inputs" if answer.found.driven else "release angles")
        if source == "noise" and runs is not None:
            conditions = runs.conditions(answer.freedom, robot=answer.found.robot)
            what = f"Make {counted(runs.count, 'more run')}: {conditions}"
        yield NextStep(what, listed(gains))


_NARROWS = {
    "noise": "Repeat every run three times more",
    "scatter": "Repeat every run three times more",
    "freed form": "Add runs with other {other}",
    "air density": "State the air density to one more digit",
}
"""The steps on the rig that narrow an interval, by the source of most of its variance."""
_CUT = {"noise": 0.75, "scatter": 0.75}
"""Share of a source's variance that the step removes at most: three quarters with four times the runs, else
all."""


def _narrower(answer: Findings) -> str:
    """The coefficient that gains most if the other answers are ruled out; empty where none gains a third."""
    after = {name: one for name, one in answer.coefficients.after.items() if one.std and one.value}
    most = max(after, key=lambda name: after[name].shares.get("rivals", 0.0), default="")
    if not most or after[most].shares.get("rivals", 0.0) < _GAINS:
        return ""
    becomes = _becomes(most, after[most], after[most].shares["rivals"])
    return f"; {becomes}" if becomes else ""


_GAINS = 0.55  # share of a variance: without it the standard deviation falls by a third


def _becomes(name: str, given: Quantity, part: float) -> str:
    """The interval of a coefficient without a part of its variance, such as ``Cnr becomes ± 5 % (now ± 12 %)``.

    Empty where both are shown alike.
    """
    now = given.reach / abs(given.value)
    left = now * math.sqrt(max(1.0 - part, 0.0))
    before, after = within(now), within(left)
    return "" if before == after else f"{COEFFICIENTS.get(name, name)} becomes {after} (now {before})"
