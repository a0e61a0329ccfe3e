"""What to do next, and the run to make, in sentences."""

from __future__ import annotations

from collections.abc import Mapping

from diagnosis.words.names import Document, plain, windy
from tunnel_sim.effects import known_effects

LEAST_SEPARATION = 3.0
"""Standard deviations between two answers below which a run does not distinguish them: odds of about 100:1."""


def run_to_make(document: Document) -> Document | None:
    """The run that distinguishes the answers; None where none is proposed, or the best one would not."""
    run: Document | None = document["next_run"]
    return run if run is not None and run["separation"] >= LEAST_SEPARATION else None


def unplannable(document: Document) -> str:
    """Why no run can be planned from these runs, in a sentence; empty where one can."""
    known = document["coefficients"]["before"]
    if not known:
        return "No run can be planned: the nominal model was not fitted to any run."
    if "omega_n" in known:
        return "No run can be planned, because no spring is stated: state spring_stiffness for every run."
    return ""


def too_close(run: Mapping[str, float]) -> str:
    """That no run distinguishes two answers, in a sentence."""
    return (
        "No run that can be set distinguishes these answers: with the best one they differ by "
        f"{run['separation']:.1f} standard deviations of the noise."
    )


def rival_lines(document: Document) -> list[str]:
    """Effects that the runs cannot distinguish from the causes, and the run that could; none without a rival."""
    decided = document.get("decided", True)
    rivals, run = document["ambiguous_with"] if decided else (), document["next_run"]
    lines = []
    if rivals:
        lines.append(f"These runs cannot distinguish it from: {', '.join(rivals)}")
    if run is not None and run_to_make(document) is None:
        lines.append(too_close(run))
    elif run is not None:
        which = "A run that could" if decided else "A run that would distinguish the likely answers"
        lines.append(f"{which}: {run_words(run)}")
    elif rivals:
        lines.append(
            "The run that could cannot be computed from these runs: state every spring_stiffness, or add runs"
        )
    return lines


def run_words(run: Mapping[str, float]) -> str:
    """A run to make, in words.

    Args:
        run: spring stiffness (N m/rad), wind speed (m/s), release angle (rad), duration (s) and separation in
            standard deviations of the noise.
    """
    wind = "wind off" if run["wind_speed"] == 0.0 else f"wind at {run['wind_speed']:g} m/s"
    return (
        f"spring of {run['spring_stiffness']:g} N m/rad, {wind}, released at {run['release_angle']:.2g} rad, "
        f"{run['duration']:g} s long (the two then differ by {run['separation']:.0f} standard deviations)"
    )


def next_steps(document: Document) -> list[str]:
    """What to do next, in the order in which to do it."""
    causes = document["causes"]
    steps = [
        f"{', '.join(remark['runs']) or 'The campaign'}: {remark['remedy']}."
        for remark in document.get("remarks", ())
        if remark["outcome"] != "noted"
    ]
    if (run := run_to_make(document)) is not None and document["ambiguous_with"]:
        words = f"Make the run that distinguishes the answers: {run_words(run)}."
        steps.append(f"{words} Add it to the campaign and diagnose again.")
    if not causes:
        return [*steps, "Use the coefficients of the nominal model, within their intervals."]
    if not document.get("decided", True):
        springs = not unplannable(document) and document.get("model") is None  # stated, and can be chosen
        kinds = ["springs"] * springs + ["wind speeds"] * windy(document) + ["release angles"]
        steps += [
            f"Add runs with other {plain(*kinds)}, and diagnose again: no answer has a probability of one half.",
            "Do not repair the rig on this answer, and do not rely on the coefficients of any one cause.",
        ]
    elif causes == ["unknown"]:
        steps += [
            "Read where the model departs from the runs, and examine the rig there.",
            "State the effect that you suspect in a file, and diagnose again with --effects-file.",
        ]
    else:
        known = {kind.name: kind.advice for kind in known_effects()}
        steps += [
            *(f"{known.get(name) or f'Repair or model what {plain(name)} stands for'}." for name in causes),
            "Measure again, and compare the two diagnoses (tunnel compare).",
            "Until then use the coefficients with the causes, not those of the nominal model.",
        ]
    if (document.get("rest") or {}).get("material"):
        steps.append(
            "Do not trust the coefficients beyond their intervals: what remains of the gap moves them."
        )
    return steps
