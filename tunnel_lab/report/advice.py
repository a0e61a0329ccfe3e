"""What to do next, in words: the steps after a diagnosis, and the run that distinguishes its rivals."""

from __future__ import annotations

from diagnosis.printing import plain, run_words
from identification.printing import significant
from tunnel_lab.report.view import Document, windy
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


def _other_runs(document: Document) -> str:
    """What further runs can differ in: a spring only where springs are stated and can be chosen."""
    springs = not unplannable(document) and document.get("model") is None
    kinds = ["springs"] * springs + ["wind speeds"] * windy(document) + ["release angles"]
    return plain(*kinds)


def next_steps(document: Document) -> list[str]:
    """What to do next, in the order in which to do it."""
    causes, rest = document["causes"], document.get("rest") or {}
    steps = [
        f"{', '.join(remark['runs']) or 'The campaign'}: {remark['remedy']}."
        for remark in document.get("remarks", ())
        if remark["outcome"] != "noted"
    ]
    if (run := run_to_make(document)) is not None and document["ambiguous_with"]:
        steps.append(
            f"Make the run that distinguishes the answers: {run_words(run)}. "
            "Add it to the campaign and diagnose again."
        )
    if not causes:
        return [*steps, "Use the coefficients of the nominal model, within their intervals."]
    if not document.get("decided", True):
        steps.append(
            f"Add runs with other {_other_runs(document)}, and diagnose again: no answer has a probability of "
            "one half."
        )
        steps.append(
            "Do not repair the rig on this answer, and do not rely on the coefficients of any one cause."
        )
    elif causes == ["unknown"]:
        steps.append("Read where the model departs from the runs, and examine the rig there.")
        steps.append("State the effect that you suspect in a file, and diagnose again with --effects-file.")
    else:
        known = {kind.name: kind.advice for kind in known_effects()}
        steps += [
            f"{known.get(name) or f'Repair or model what {plain(name)} stands for'}." for name in causes
        ]
        steps.append("Measure again, and compare the two diagnoses (tunnel compare).")
        steps.append("Until then use the coefficients with the causes, not those of the nominal model.")
    if rest.get("material"):
        steps.append(
            "Do not trust the coefficients beyond their intervals: what remains of the gap moves them."
        )
    return steps


def next_run_rows(document: Document) -> list[tuple[str, str]]:
    """The run expected to distinguish the rivals.

    Returns:
        Labels and values; empty where none is proposed.
    """
    run = document["next_run"] or {}
    units = {
        "spring_stiffness": "N m/rad",
        "wind_speed": "m/s",
        "release_angle": "rad",
        "duration": "s",
        "separation": "standard deviations of the noise, expected",
    }
    return [
        (plain(name).capitalize(), f"{significant(value, 3)} {units.get(name, '')}".strip())
        for name, value in run.items()
        if isinstance(value, int | float)
    ]
