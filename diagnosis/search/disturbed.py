"""Disturbed runs, and the campaign without the readings after the disturbance.

A cause acts in all runs. A run counts as disturbed where its greatest jump exceeds chance in the run itself and
the greatest jumps of the other runs, so dropped samples, turbulence or a ringing rod do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from diagnosis.likelihood.compression import compressed
from diagnosis.likelihood.least_squares import Fit
from diagnosis.likelihood.residuals import resonance
from diagnosis.model.nominal import NominalModel
from diagnosis.noise.gap import GapTest
from diagnosis.search.clock import StepClock
from diagnosis.search.disturbance import Disturbance
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.odd_run import DISTURBED_FEWEST, DISTURBED_KEPT, DISTURBED_SHARE, odd_alone
from diagnosis.search.prepared import Prepared, prepared_and_tested
from diagnosis.search.scatter import scattered
from diagnosis.settings import SelectionSettings, Settings
from diagnosis.where.jumps import Jumps, jumps, starts
from tunnel_sim.effects import Effect
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

_EARLY = 0.25  # share of a run in which a disturbance may belong to its release


def prepared_undisturbed(
    measured: Campaign,
    model: NominalModel,
    kinds: Sequence[type[Effect]],
    clock: StepClock,
    settings: Settings,
) -> tuple[Prepared, GapTest, tuple[Disturbance, ...]]:
    """As `prepared_and_tested`, without disturbances if there is a gap, and without a run that alone shows it.

    Raises:
        TunnelError: when the nominal model cannot be fitted to the runs.
    """

    def prepared_of(campaign: Campaign) -> tuple[Prepared, GapTest]:
        return prepared_and_tested(campaign, model.of(campaign), kinds, clock, settings)

    prepared, test = prepared_and_tested(measured, model, kinds, clock, settings)
    if not test.detected and not prepared.cut:
        return prepared, test, ()
    with clock.step("where"):
        disturbed = disturbances(measured, prepared.nominal)
    if disturbed:
        try:
            measured = undisturbed(measured, disturbed)
            prepared, test = prepared_of(measured)
        except TunnelError:  # the other runs do not determine the model
            disturbed = tuple(replace(disturbance, kept_until_s=None, used=True) for disturbance in disturbed)
    if not (test.detected or prepared.cut) or any(disturbance.used for disturbance in disturbed):
        return prepared, test, disturbed
    with clock.step("where"):
        nominal = compressed(prepared.uncut) if prepared.uncut else prepared.in_wider_blocks().nominal
        odd = odd_alone(measured, nominal, kinds)
    for some in dict.fromkeys([odd, tuple(replace(run, kept_from_s=None) for run in odd)]) if odd else ():
        with suppress(TunnelError):
            others, without = prepared_of(undisturbed(measured, some))
            if not others.cut and (not without.detected or differs(others.in_wider_blocks().nominal, kinds)):
                return others, without, together(disturbed, some)
    return prepared, test, disturbed


def differs(nominal: Fit, kinds: Sequence[type[Effect]]) -> bool:
    """Whether chance differences between the runs explain the whole gap of the nominal model."""
    fitted = scattered(nominal, kinds)
    return fitted is not None and Hypothesis((), fitted).explains_runs


def together(*found: Sequence[Disturbance]) -> tuple[Disturbance, ...]:
    """Disturbances found in several campaigns; for each run the last one."""
    by_run = {one.run: one for several in found for one in several}
    return tuple(by_run[run] for run in sorted(by_run))


def disturbances(measured: Campaign, nominal: Fit) -> tuple[Disturbance, ...]:
    """The disturbed runs, tested together at one false-alarm rate.

    Args:
        measured: the campaign in its own units.
        nominal: fit of the nominal model to the similar campaign.
    """
    similarity, chosen = nominal.problem.data.similarity, nominal.settings.selection
    data, clocks = nominal.problem.data, {run.id: run.record.time_s[0] + run.clock_s for run in measured.runs}
    index = {run.id: place for place, run in enumerate(data.runs)}
    disturbed: dict[str, Disturbance] = {}

    def clock(name: str, time: float) -> float:
        """A time since the start of a run's fitted part on the clock of its file, s."""
        return float(clocks[name]) + similarity.own(data.runs[index[name]].start + time, "s")

    def kept_from(name: str, time: float) -> float | None:
        """The clock at that instant if enough of the run follows; else None."""
        run, frequency = data.runs[index[name]], resonance(nominal, index[name])
        span = run.reading.size * run.interval
        follows = (span - time) * frequency >= DISTURBED_KEPT and time < _EARLY * span
        return clock(name, time) if follows else None

    first_cycles = {cycle.id: cycle for cycle in starts(nominal)}
    for name, p_value in beyond_the_others(list(first_cycles.values()), chosen):
        held = first_cycles[name]
        free = float(held.time[held.drop > 1.0][-1]) + 1.0 / resonance(nominal, index[name])
        disturbed[name] = Disturbance(name, None, None, p_value, kept_from_s=kept_from(name, free))
    by_run = {jump.id: jump for jump in jumps(nominal)}
    for name, p_value in beyond_the_others(list(by_run.values()), chosen):
        jump = by_run[name]
        most = int(np.argmax(jump.drop))
        # fits that include a large jump show it early; it may begin a cycle before it appears
        first, frequency = most, resonance(nominal, index[name])
        while first > 0 and _clear(float(jump.chance[first - 1]), chosen):
            first -= 1
        at = float(jump.time[most])
        last = min(float(jump.time[first]), at - 1.0 / frequency)
        until = clock(name, last) if last * frequency >= DISTURBED_KEPT else None
        # a start that is not free, such as a hand that holds the body: the remaining part is used
        begins = None if until is not None else kept_from(name, at + 1.0 / frequency)
        disturbed[name] = Disturbance(name, clock(name, at), until, p_value, kept_from_s=begins)
    return tuple(sorted(disturbed.values(), key=lambda disturbance: disturbance.run))


def beyond_the_others(runs: Sequence[Jumps], chosen: SelectionSettings) -> list[tuple[str, float]]:
    """The runs with a greatest jump beyond chance and beyond the others' jumps; with the larger p-value.

    The logarithms of the greatest jumps are tested from the outside inwards for up to a given share of outliers
    (generalised ESD; Rosner, Technometrics 25 (1983) 165, doi 10.1080/00401706.1983.10487848), by Student's t
    of a run among the runs with smaller jumps. Few runs do not determine the scatter of the jumps, so it has a
    prior.
    """
    if len(runs) < DISTURBED_FEWEST:
        return []
    from scipy.special import stdtr  # imported here because it is slow to load

    instants = sum(run.drop.size for run in runs)
    # a value below the maximum expected by chance of as many χ² is not a jump
    sizes = np.log([max(float(run.drop.max()), 2.0 * np.log(run.drop.size), 1.0) for run in runs])
    order = np.argsort(-sizes)
    most = min(max(1, int(DISTURBED_SHARE * len(runs))), len(runs) - 2)
    p_values = []
    for place in range(most):
        tested, others = order[place], sizes[order[place + 1 :]]
        prior, count = chosen.disturbed_prior, others.size
        freedom = prior + count - 1
        scatter = prior * chosen.disturbed_scatter**2 + (count - 1) * float(np.var(others, ddof=1))
        std = np.sqrt(scatter / freedom * (1.0 + 1.0 / count))
        apart = (count + 1) * float(stdtr(freedom, -(sizes[tested] - others.mean()) / std))
        by_chance = instants * float(runs[tested].chance.min())
        p_values.append(min(1.0, max(apart, by_chance)))
    clear = [place for place, p in enumerate(p_values) if _clear(p, chosen)]
    return [(runs[order[place]].id, p_values[place]) for place in range(clear[-1] + 1 if clear else 0)]


def _clear(p_value: float, chosen: SelectionSettings) -> bool:
    return p_value < chosen.disturbed_rate


def undisturbed(campaign: Campaign, disturbed: Sequence[Disturbance]) -> Campaign:
    """The campaign with the undisturbed part of disturbed runs, or without them.

    Raises:
        TunnelError: where no run would remain.
    """
    by_run = {disturbance.run: disturbance for disturbance in disturbed}
    remaining = campaign.without([name for name, disturbance in by_run.items() if disturbance.left_out])
    runs = []
    for run in remaining.runs:
        disturbance = by_run.get(run.id)
        if disturbance is not None and not disturbance.used:
            clock = run.record.time_s + run.clock_s
            begin, end = disturbance.kept_from_s, disturbance.kept_until_s
            inside = (clock >= (-np.inf if begin is None else begin)) & (
                clock < (np.inf if end is None else end)
            )
            run = replace(run, record=Record(run.record.time_s[inside], run.record.yaw_rad[inside]))
        runs.append(run)
    return replace(remaining, runs=tuple(runs))
