"""Caveats of an answer, each with its remedy."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.detection.sensor_noise import Noise
from diagnosis.policy import FEW_RUNS, NOISE_CONTRADICTED
from diagnosis.result import Confirmation, RunGap
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
