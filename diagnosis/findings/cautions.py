"""Caveats, remarks on the noise, and notes, each under the kind of its fact.

A sentence is a template filled with the fact's figures, or a function of them where a template is not enough.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from diagnosis.model.fact import Fact, Noted
from identification.show.numbers import part, plain, reading_shown, share
from identification.status import Outcome, Remark

Figures = Mapping[str, Any]
Sentence = str | Callable[[Figures], str]

UNPATCHED = "The causes could not be written into the model"
_NOISE = "The noise of the records is {ratio:.3g} times the level that noise_std and resolution state"
_LEFT_OUT = (
    "Left out, because they state {} spring_stiffness and the others {}: {{runs}}. State it for all runs, or "
)


def _not_confirmed(given: Figures) -> str:
    return (
        f"The integrator of the fits differs from the MuJoCo model by {given['rms_rad']:2} (root mean square "
        f"over {given['run']}), more than {part(given['tolerance'])} of the noise ({given['tolerance_rad']:2}). "
        "The gap before and after comes from MuJoCo. The parameters and probabilities come from the fits and may "
        "have an error of this size."
    )


def _few_runs(given: Figures) -> str:
    motion, others = "decay", "with other springs and release angles"
    if given["driven"]:
        motion, others = "motion", "with other inputs"
    if given["windy"]:
        others = f"with other springs, wind speeds and {'inputs' if given['driven'] else 'release angles'}"
    number = "is one run" if given["runs"] == 1 else f"are {given['runs']} runs"
    told = f"the form of the {motion} alone distinguishes causes"
    fault = " A fault of this run cannot be told from a cause." if given["runs"] == 1 else ""
    return f"There {number} only: {told}.{fault} Add runs {others}."


def _none_held_out(given: Figures) -> str:
    each = "spring, with the wind off and on" if given["windy"] else "run"
    return (
        "No run could be held out of the fit, so the gap of each run is the gap of the fit. The gap of all runs is "
        f"predicted for held-out stretches of time. Repeat every {each}: a held-out run is a stronger test than "
        "a stretch."
    )


def _forms(names: Sequence[str]) -> str:
    """Parameters of forms, such as ``the exponent of coulomb friction``."""
    parts = (name.split(".") for name in names)
    return " and ".join(f"the {own.replace('_', ' ')} of {plain(effect)}" for effect, own in parts)


def _unresolved(given: Figures) -> str:
    return (
        f"{plain(*given['effects']).capitalize()} was fitted to the whole records and left out of the answer: "
        "neither their early half nor their late half, fitted alone, shows it."
    )


def _contradicted(given: Figures) -> str:
    return (
        f"{plain(*given['effects']).capitalize()} was left out of the answer: without run {given['run']} the "
        "other runs do not show it, although they could."
    )


def _only_one_run(given: Figures) -> str:
    return (
        f"Only run {given['run']} shows {plain(*given['effects'])}: the other runs could not, so a fault of this "
        "run is not excluded. Repeat it."
    )


def _explains_too_much(given: Figures) -> str:
    return (
        f"{plain(*given['effects']).capitalize()} was left out of the answer: it would explain more than the "
        "nominal model leaves in its runs."
    )


CAUTIONS: Mapping[str, Sentence] = {
    "stated": "{words}",
    "stiffness not stated": f"{_LEFT_OUT.format('no', 'do')}diagnose these separately.",
    "stiffness stated": f"{_LEFT_OUT.format('their', 'do not')}diagnose these separately.",
    "other springs": "Left out, because different frequencies at one wind speed show more than one spring, and "
    "these runs may have another spring: {runs}. State spring_stiffness, or diagnose these separately.",
    "another mode": "Left out, because they oscillate in another mode, at least {ratio:g} times as fast as the "
    "same spring with the wind off: {runs}. Diagnose these separately.",
    "no sensor effect tried": "No effect of the sensor is tried on {quantity}s.",
    "only a second mode tried": "A second mode is the only effect of the sensor that is tried on {quantity}s.",
    "by moment": "The body has no restoring moment, so small errors of a moment accumulate in its angle, and every "
    "model departs from it. Effects are therefore compared by the residual moment. The fits treat it as random "
    "noise; parameters, coefficients and the shares in the table of answers come from these fits. All other sizes "
    "and shares refer to the angle.",
    "unpatched": f"{UNPATCHED}: {{reason}}.",
    "one spring assumed": "No run states spring_stiffness, so all runs are assumed to have the same spring, and "
    "moments are per unit inertia. State it, or leave out the runs with another spring: a different spring looks "
    "like a gap.",
    "floor": "The records contain almost no noise ({records_rad:1}). The accuracy of the fits, "
    "{fits_rad:1}, is used instead, and a smaller gap is not detected. Add sensor noise to simulated "
    "records.",
    "less noise than stated": f"{_NOISE}. The answer is based on the noise found in the records; correct noise_std "
    "or leave it out.",
    "more noise than stated": f"{_NOISE}, and noise above the stated level counts as a gap. If the sensor really "
    "is this noisy, correct noise_std or leave it out.",
    "not followed": "The MuJoCo model could not follow the fitted motion ({failure}), so all figures come from the "
    "integrator of the fits. Do not rely on the fitted parameters.",
    "not confirmed": _not_confirmed,
    "few runs": _few_runs,
    "none held out": _none_held_out,
    "some not held out": "Not held out of the fit, because no other run has the same spring or wind: {runs}. There "
    "the gap with the causes is the gap of the fit. Repeat every such run.",
    "cut": "The nominal model fits poorly, so each record is used only from its second passage through the centre "
    "until its motion ends. A start by hand and a body at rest are not free decays. The coefficients before the "
    "causes may therefore differ from identify's, which uses the whole record.",
    "unresolved": _unresolved,
    "one amplitude": lambda given: (
        "Not determined: one release amplitude does not show whether the form of a law is right, so "
        f"{_forms(given['parameters'])} may be wrong by more than the deviation stated. Add releases from other "
        "angles."
    ),
    "needless": lambda given: (
        f"{plain(*given['effects']).capitalize()} was fitted and left out of the answer: with it the residual on "
        "held-out readings is no smaller than without it."
    ),
    "contradicted": _contradicted,
    "explains too much": _explains_too_much,
    "only one run": _only_one_run,
    "rested": "The body is at rest at the end of {runs}. The fits omit that part: it says little about the "
    "motion.",
    "zeros apart": lambda given: (
        f'A separate zero for each run would explain {share(given["share"])} of the gap. State zero = "per_run" '
        "under [sensor], and diagnose again, if the sensor or its mount may have moved between the runs."
    ),
    "beyond reach": lambda given: (
        f"By linear theory all known effects together would leave at least {share(given['left'])} of the gap "
        "unexplained, so no larger sets of effects were tried."
    ),
    "remainder not sought": "No formula for the remaining gap is sought for a driven body without a restoring "
    "moment: small errors of a moment accumulate in its angle.",
    "remainder not solved": "The explainable share of the remaining gap was not found: its equations "
    "cannot be solved.",
}
"""Caveats of an answer."""

NOISE: Mapping[str, Sentence] = {
    "coloured": "it is coloured, {std_rad:3} in all",
    "floor": "the records contain {std_rad:1}, in {fewer} of {runs} runs less than the accuracy of the fits, "
    "which is used instead",
    "not stated": "the campaign states no noise",
    "agrees": "the records agree: {std_rad:3} ± {uncertainty_rad:1}",
    "contradicts": "the records contradict the stated {stated_rad:3}: they contain {std_rad:3} ± "
    "{uncertainty_rad:1}",
    "differs by run": "the records contradict the stated {stated_rad:3}: their noise differs by run, "
    "{least_rad:3} to {most_rad:3}",
    "some runs differ": "most records agree with the stated {stated_rad:3}, and others do not: {least_rad:3} to "
    "{most_rad:3}",
}
"""Clauses that give the reason for the noise used."""

REMARKS: Mapping[str, tuple[Sentence, str]] = {
    "within step": (
        "the residual is smaller than the steps of the readings, and the error of the steps may follow the motion",
        "use a finer resolution to see smaller gaps",
    ),
    "coloured": (
        "the sensor's noise is coloured: {std_rad:3} in all, and its power per hertz varies by a factor of "
        "{power_ratio:.3g} over a factor of {frequency_ratio:.3g} in frequency, in the same way throughout the "
        "runs",
        "the diagnosis allows for it; it is not a cause",
    ),
    "not judged": (
        "sampled too slowly to test whether the noise follows the motion or comes in bursts",
        "sample faster to test it",
    ),
    "harmonic of the hum": (
        "the strongest line of the hum is at {line_hz:.5g} Hz, {harmonic} times the mains' frequency",
        "the stated amplitude is this line's",
    ),
    "folded hum": (
        lambda given: (
            f"the hum's line of {given['line_hz']:.5g} Hz is above half the sample rate and appears at "
            f"{' to '.join(f'{place:.5g}' for place in given['places_hz'])} Hz"
        ),
        "sample faster to see it at its true frequency",
    ),
    "other mains": (
        "mains of {other_hz:.5g} Hz would show the same line as mains of {mains_hz:.5g} Hz at this sample rate",
        "sample faster to distinguish them",
    ),
}
"""Remarks on the noise, with their remedies."""

PATCH: Mapping[str, Sentence] = {
    "polynomial": "The {moment} is written as a polynomial of third order, which misses {missed_percent:.2g} % of "
    "its greatest moment within the records.",
    "no native element": "The {moment} has no native element; the plugin vwt.yaw_moment adds it. Call "
    "tunnel_sim.load_plugin() before MuJoCo reads the file.",
    "by plugin": "MuJoCo reads this patch only with the plugin. In native elements alone, by --native or .native, "
    "the model explains {native_percent:.3g} % of the gap instead of {percent:.3g} %.",
    "own law left out": "An effect of your own is left out: only the plugin has it.",
    "delayed control": "No file holds the past of a delayed control, which MuJoCo starts as 0. Before a run is "
    "replayed, fill it with the first control, here of the key frame: "
    "mujoco.mj_initCtrlHistory(model, data, {index}, None, numpy.full(({samples}, 1), data.ctrl[{index}])).",
    "soft friction": "frictionloss is a soft constraint: below {below_per_s:.2g} {unit}/s it acts as a damper, "
    "and a joint at rest by friction creeps. Its time constant is set to two steps, the shortest allowed.",
    "friction against load": "The friction that depends on the load of the joint is written as its mean over the "
    "travel: it has no native element.",
    "rod": "The twist of the rod is left out: it needs a further body and joint.",
    "delayed input": "The delay of the input is not part of the model; the comparison applies it to the input.",
    "actuator": "The actuator is not part of the model; the comparison applies its effect to the input.",
    "air": "The moment of the air is left out: the patched model describes the runs with the wind off.",
    "sensor": lambda given: (
        f"Effects of the sensor are not part of the model: {', '.join(plain(name) for name in given['effects'])}; "
        "the comparison applies them to the reading."
    ),
    "early steps": "The model's integrator moves the joint half a step, {half_step_ms:.3g} ms, before its input; "
    "RK4 and shorter steps do not. The apparent inertia of dampers in such steps is subtracted from the value "
    "written.",
}
"""Sentences on the differences between the patched model and the law found."""


@dataclass(frozen=True)
class _Reading:
    """A reading in a sentence, with as many digits as its format asks for.

    Args:
        value: the reading, in the unit.
    """

    value: float
    unit: str

    def __format__(self, digits: str) -> str:
        return reading_shown(self.value, int(digits), self.unit)


def sentence_of(sentences: Mapping[str, Sentence], given: Fact, unit: str = "rad") -> str:
    """The sentence of a fact of the document.

    Args:
        given: the fact; figures with names ending in ``_rad`` are readings.
        unit: unit of the readings: rad, rad/s or rad/s².
    """
    sentence = sentences[given.kind]
    shown = {
        name: _Reading(one, unit) if name.endswith("_rad") else one for name, one in given.figures.items()
    }
    if callable(sentence):
        return sentence(shown)
    listed = {name: ", ".join(one) if isinstance(one, list | tuple) else one for name, one in shown.items()}
    return sentence.format(**listed)


def remark(given: Noted, unit: str = "rad") -> Remark:
    """The remark for a fact about the noise; arguments as in `sentence_of`."""
    what, remedy = REMARKS[given.fact.kind]
    return Remark(Outcome.NOTED, given.runs, sentence_of({given.fact.kind: what}, given.fact, unit), remedy)
