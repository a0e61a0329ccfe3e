"""Caveats of an answer, each with its remedy."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.detection.sensor_noise import Noise
from diagnosis.result import Confirmation, RunGap
from tunnel_sim.vocabulary.campaign import Campaign

_FEW = 3
#: Stated noise this many times too small or too large is said; its rounding to one digit reaches half of that.
_CONTRADICTED = 3.0


def cautions(
    campaign: Campaign, noise: Noise, runs: Sequence[RunGap], confirmation: Confirmation, *, named: bool
) -> tuple[str, ...]:
    """Say what is missing for a firm answer.

    Args:
        campaign: the runs.
        noise: found in them, rad².
        runs: which of them could be held out.
        confirmation: whether the fits' integrator agrees with the MuJoCo model.
        named: whether effects are named, so that there is something to hold runs out of.

    Returns:
        Sentences; none where nothing is missing.
    """
    found = [*_stiffness(campaign), *_noise(noise), *_integrators(confirmation)]
    if len(campaign.runs) < _FEW:
        number = "one run" if len(campaign.runs) == 1 else f"{len(campaign.runs)} runs"
        found.append(
            f"There {'is' if len(campaign.runs) == 1 else 'are'} {number} only: causes are told apart by the form "
            f"of the decay alone. Add runs with other springs, wind speeds and release angles."
        )
    fitted = [run.id for run in runs if not run.held_out]
    if named and len(fitted) == len(runs):
        found.append(
            "No run could be held out of the fit, so the closure is that of the fitted runs, not a prediction. "
            "Repeat every spring, with the wind off and on."
        )
    elif named and fitted:
        found.append(
            f"Not held out, since no other run has their spring or wind: {', '.join(fitted)}. "
            f"Their gap after is that of the fit; repeat them."
        )
    return tuple(found)


def _stiffness(campaign: Campaign) -> list[str]:
    if len(campaign.runs) == 1 or any(run.spring_stiffness is not None for run in campaign.runs):
        return []
    return [
        "No run states spring_stiffness, so all runs are taken to have the same spring, and moments are per unit "
        "inertia. State it, or leave out runs with another spring: a different spring looks like a gap."
    ]


def _noise(noise: Noise) -> list[str]:
    std = noise.estimated**0.5
    if noise.source == "floor":
        return [
            f"The records hold next to no noise ({std:.1g} rad): the fits' own accuracy, "
            f"{noise.used**0.5:.1g} rad, stands in for it, and a gap smaller than that is not seen. Add noise of "
            f"the sensor's size to simulated records."
        ]
    if noise.stated_variance is None:
        return []
    ratio = std / noise.stated_variance**0.5
    if 1.0 / _CONTRADICTED < ratio < _CONTRADICTED:
        return []
    said = f"The records' noise is {ratio:.3g} times what noise_std and resolution state"
    if ratio < 1.0:
        return [
            f"{said}. The answer rests on the noise found in the records; correct noise_std or leave it out."
        ]
    return [
        f"{said}, and noise above the stated counts as a gap. If that is how the sensor is, correct noise_std or "
        f"leave it out."
    ]


def _integrators(confirmation: Confirmation) -> list[str]:
    if confirmation.failure:
        return [
            f"The MuJoCo model could not follow the fitted motion ({confirmation.failure}), so the figures are "
            f"those of the fits' own integrator alone. Do not rely on the parameters fitted."
        ]
    if confirmation.agrees:
        return []
    return [
        f"The fits' own integrator departs from the MuJoCo model by {confirmation.rms_difference:.1e} rad (root "
        f"mean square over {confirmation.run}), more than a tenth of the noise ({confirmation.tolerance:.1e} rad). "
        f"The gap before and after is MuJoCo's; parameters and probabilities are the fits' and may be off by as "
        f"much."
    ]
