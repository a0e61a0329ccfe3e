"""Sentences on disturbed runs: the parts that are used, and remedies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from diagnosis.findings.finding import NextStep
from diagnosis.findings.terms import named_runs
from diagnosis.search.disturbance import Disturbance
from identification.show.numbers import with_std

OWN_DIFFERS: Final = 4.0
"""Minimum difference of an odd run's frequency or damping ratio from the others' to be stated, in standard
deviations. Convention."""


def disturbed_words(found: Disturbance, *, no_gap: bool) -> str:
    """A sentence on a disturbed run and the part of it that is used.

    Args:
        no_gap: whether the runs show no gap without the disturbance.
    """
    run, kept, at, begins = found.run, found.kept_until_s, found.at_s, found.kept_from_s
    if found.used:
        what = (
            f"was disturbed at {at:.4g} s"
            if at is not None
            else "does not move as the others do at its start"
        )
        why = "the other runs do not determine the model"
        return f"Run {run} {what}. It is used nevertheless, because {why}."
    if at is None:
        if begins is not None:
            part = "Without that part there is no gap, so it" if no_gap else "That part"
            return f"Run {run} does not move as the others do before {begins:.4g} s. {part} is not used."
        whole = "Without it there is no gap, so it" if no_gap else "It"
        return f"Run {run} differs from the others{_own_motion(found)}. {whole} is not used."
    unused = "it is not used" if kept is None else f"its readings from {kept:.4g} s on are not used"
    if begins is not None:
        unused = f"its readings before {begins:.4g} s are not used"
    return f"Run {run} was disturbed at {at:.4g} s; {unused}."


def disturbed_step(found: Disturbance) -> NextStep:
    """The remedy for a disturbed run."""
    again = "all its readings then count"
    if found.at_s is not None:
        return NextStep(f"Repeat run {found.run}, which was disturbed at {found.at_s:.4g} s", again)
    if found.kept_from_s is not None:
        begins = f"whose free motion begins only at {found.kept_from_s:.4g} s"
        return NextStep(f"Look at the release of run {found.run}, {begins}", again)
    looked_at = "its release, its unit, its gain and its filter"
    if found.as_they and _differs(found):
        looked_at = "its spring, its clock and what was mounted in it"
    return NextStep(f"Repeat run {found.run}, which differs from the others, or look at {looked_at}", again)


def _own_motion(found: Disturbance) -> str:
    """How a run differs as a whole, after a colon or a comma; empty where it is not known.

    Numbers are stated only where they explain the difference: a run of another form has no frequency of its own.
    """
    if found.frequency is None:
        return ""
    if not found.as_they:
        return ", and not in frequency and damping alone"
    said = _differs(found)
    return f": {' and '.join(said)} than the model of the others predicts" if said else ""


def _differs(found: Disturbance) -> list[str]:
    """The numbers of a run that differ from the other runs', such as ``its frequency is 0.250 ± 0.010 % lower``."""
    said = []
    for name, own in (("frequency", found.frequency), ("damping ratio", found.damping)):
        if own is not None and own.std is not None and abs(own.value) > OWN_DIFFERS * own.std:
            size = with_std(100.0 * abs(own.value), 100.0 * own.std)
            said.append(f"its {name} is {size} % {'higher' if own.value > 0.0 else 'lower'}")
    return said


def odd_runs(found: Sequence[Disturbance]) -> str:
    """Disturbed runs and runs that differ from the others, after a semicolon; empty without any."""
    disturbed = [one.run for one in found if one.at_s is not None]
    late = [one.run for one in found if one.at_s is None and one.kept_from_s is not None and not one.used]
    odd = [one.run for one in found if one.at_s is None and one.run not in late]
    said = f"; {named_runs(disturbed)} disturbed" if disturbed else ""
    said += f"; the start of {named_runs(late)} not used" if late else ""
    differ = "differ from the others" if len(odd) > 1 else "differs from the others"
    return said + (f"; {named_runs(odd)} {differ}" if odd else "")
