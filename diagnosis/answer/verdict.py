"""The answer in plain words, and its caveats, each with its remedy."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.closure import Remainder, of_swing, rms_shown
from diagnosis.noise.sensor_noise import Noise
from diagnosis.policy import FEW_RUNS, NOISE_CONTRADICTED
from diagnosis.printing import Decision, plain, probability, share, undecided_words
from diagnosis.result import Confirmation, GapSummary, RunGap
from diagnosis.search.weigh import UNKNOWN
from identification.printing import significant
from tunnel_sim.effects import effect_class
from tunnel_sim.vocabulary.campaign import Campaign


def cautions(
    campaign: Campaign, noise: Noise, runs: Sequence[RunGap], confirmation: Confirmation, *, named: bool
) -> tuple[str, ...]:
    """The caveats of an answer.

    Args:
        noise: found in them.
        runs: the gap by run, which says whether the run could be held out of the fit.
        confirmation: whether the fits' integrator agrees with the MuJoCo model.
        named: whether the answer names effects; only then are runs held out of a fit.

    Returns:
        Sentences; none where there is nothing to caution against.
    """
    found = [*_stiffness(campaign), *_noise(noise), *_integrators(confirmation)]
    if len(campaign.runs) < FEW_RUNS:
        number = "one run" if len(campaign.runs) == 1 else f"{len(campaign.runs)} runs"
        found.append(
            f"There {'is' if len(campaign.runs) == 1 else 'are'} {number} only: causes are distinguished by the "
            f"form of the decay alone. Add runs with other springs, wind speeds and release angles."
        )
    fitted = [run.id for run in runs if not run.held_out]
    if named and len(fitted) == len(runs):
        found.append(
            "No run could be held out of the fit, so the share closed is that of the fitted runs. The gap as the "
            "causes are added is predicted for stretches of time left out. Repeat every spring, with the wind off "
            "and on: a run left out tests more than a stretch."
        )
    elif named and fitted:
        found.append(
            f"Not held out of the fit, since no other run has the same spring or wind: {', '.join(fitted)}. "
            f"Their gap with the causes added is that of the fit; repeat these runs."
        )
    return tuple(found)


def _stiffness(campaign: Campaign) -> list[str]:
    if len(campaign.runs) == 1 or any(run.spring_stiffness is not None for run in campaign.runs):
        return []
    return [
        "No run states spring_stiffness, so all runs are assumed to have the same spring, and moments are per unit "
        "inertia. State it, or leave out the runs with another spring: a different spring looks like a gap."
    ]


def _noise(noise: Noise) -> list[str]:
    std = noise.estimated**0.5
    if noise.source == "floor":
        return [
            f"The records contain almost no noise ({std:.1g} rad). The accuracy of the fits, "
            f"{noise.used**0.5:.1g} rad, stands in for it, and a smaller gap is not detected. Add sensor noise to "
            f"simulated records."
        ]
    if noise.stated_variance is None:
        return []
    ratio = std / noise.stated_variance**0.5
    if 1.0 / NOISE_CONTRADICTED < ratio < NOISE_CONTRADICTED:
        return []
    said = f"The records' noise is {ratio:.3g} times what noise_std and resolution state"
    if ratio < 1.0:
        return [
            f"{said}. The answer is based on the noise found in the records; correct noise_std or leave it out."
        ]
    return [
        f"{said}, and noise above the stated level counts as a gap. If the sensor really is as noisy as that, "
        f"correct noise_std or leave it out."
    ]


def _integrators(confirmation: Confirmation) -> list[str]:
    if confirmation.failure:
        return [
            f"The MuJoCo model could not follow the fitted motion ({confirmation.failure}), so all figures come "
            f"from the fits' own integrator. Do not rely on the fitted parameters."
        ]
    if confirmation.agrees:
        return []
    return [
        f"The fits' own integrator differs from the MuJoCo model by {confirmation.rms_difference:.1e} rad (root "
        f"mean square over {confirmation.run}), more than a tenth of the noise ({confirmation.tolerance:.1e} rad). "
        f"The gap before and after comes from MuJoCo. The parameters and probabilities come from the fits, and may "
        f"be wrong by as much."
    ]


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
) -> str:
    """The answer in one paragraph.

    Args:
        causes: names; empty for no gap.
        found: whether the answer is decided.
        gap: how large it is, and how far it closes.
        rest: what remains.
        both_winds: whether the campaign has runs with the wind off and runs with the wind on.
    """
    if not causes:
        return (
            f"No gap: the nominal model explains the runs down to their noise "
            f"(mean squared residual over noise variance, minus one: {gap.excess_before:+.3f})."
        )
    size = _size(gap)
    if not found.decided:
        said = f"There is a gap ({size}), and its cause is undecided."
        with_first = f"With the first of them added, {share(gap.closed)} of the gap closes {gap.closed_on}."
        return " ".join((said, undecided_words(found), *(() if tuple(causes) == UNKNOWN else (with_first,))))
    if tuple(causes) == UNKNOWN:
        return f"There is a gap ({size}), and no effect of the vocabulary explains it. {rest.words}"
    several = len(causes) > 1
    sources = "; ".join(
        _source(name, both_winds=both_winds) + (f" ({plain(name)})" if several else "") for name in causes
    )
    return (
        f"The gap ({size}) comes {'only in part ' if rest.material else ''}"
        f"from {plain(*causes)} (probability {probability(found.credible[0][1])}): "
        f"{sources}. With {'them' if several else 'it'} added, {share(gap.closed)} of the gap "
        f"closes {gap.closed_on}. {rest.words}"
    )


def _size(gap: GapSummary) -> str:
    """The gap, such as ``0.134° root mean square, 2.1 % of the swing, 19.34 times the noise power``."""
    excess = gap.excess_before
    times = f"{excess:.2f}" if excess < 10.0 else significant(excess, 4)
    powers = f"{times} times the noise power"
    if gap.misfit is None:
        return powers
    return f"{rms_shown(gap.misfit, excess)} root mean square, {of_swing(gap.misfit, excess)}, {powers}"


def _source(name: str, *, both_winds: bool) -> str:
    """What an effect acts on and, where the campaign can show it, whether it needs the wind."""
    kind = effect_class(name)
    acts_on = _CHANNEL_WORDS[kind.channel]
    if not both_winds:
        return acts_on
    return f"{acts_on}, with the wind {'on' if kind.condition == 'wind_on' else 'on and off'}"


def cnr_note(causes: Sequence[str]) -> str:
    """How to read the coefficients with the causes added, where a cause changes their meaning."""
    return " ".join(
        effect_class(name).caveat for name in causes if name != "unknown" and effect_class(name).caveat
    )


BLIND_SPOTS = (
    "a constant sensor lag or filter: it only shifts the release",
    "an error of the clock",
    "a common scale on the inertia and all stiffnesses",
    "a scale error of wind speed or air density: Cnβ and Cnr absorb it",
)


_OF_INPUT = "a common scale on the inertia and the moment of the input"


def blind_spots(
    *, springs: int, speeds: int, wind_off: bool, wind_on: bool, normalised: bool, driven: bool = False
) -> tuple[str, ...]:
    """What these runs cannot show.

    Args:
        springs: number of distinct stiffnesses; 0 where nothing holds the body.
        speeds: number of distinct wind speeds above zero.
        wind_off: whether there are runs with the wind off.
        wind_on: whether there are runs with the wind on.
        normalised: whether the stiffness is not stated.
        driven: whether there are driven runs.

    Returns:
        Clauses; those that apply to every campaign come last.
    """
    found = []
    if normalised:
        found.append("an error of a single spring: the runs state no stiffness")
    elif springs == 0:
        found.append(
            "the sensor's zero, and a drift of it as opposed to a constant moment: there is no spring"
        )
    elif springs < 2:
        found.append(
            "structural as opposed to viscous damping, gravity, or a wrong stiffness: there is one spring only"
        )
    if not wind_on:
        found.append("any effect of the air: there is no run with the wind on")
    elif speeds < 2:
        found.append(
            "a lag or a wind-speed offset: there is one wind speed only, and Cnβ and Cnr absorb them"
        )
    if wind_on and not wind_off:
        found.append("whether an effect is mechanical or aerodynamic: there is no run with the wind off")
    if driven:
        found.append("a lag of the sensor as opposed to a delay of the input: only their sum shows")
        return *found, BLIND_SPOTS[1], BLIND_SPOTS[2] if springs or normalised else _OF_INPUT, BLIND_SPOTS[3]
    return (*found, *BLIND_SPOTS)
