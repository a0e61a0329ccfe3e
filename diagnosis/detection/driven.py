"""Driven runs in a diagnosis: which can be diagnosed, and with which effects."""

from __future__ import annotations

from collections.abc import Sequence

from diagnosis.detection.driven_noise import LEAST_SAMPLES
from diagnosis.fitting.least_squares import Fit
from identification.signal.driven import driven_start
from tunnel_sim.effects import Effect, the_effect
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

_ROD = the_effect(channel="stiffness", condition="always", autonomous=False)
_NOT_TRIED = "On driven runs these effects are not tried yet: {}."
_NOT_BY_MUJOCO = (
    "The driven runs are checked by the integrator of the fits in shorter steps, since the MuJoCo model does not "
    "take their input."
)

#: Said of a campaign with driven runs.
NOT_SOUGHT = (
    "What could be closed of what remains, and by which formula, is not sought where a run is driven."
)


def refuse_undiagnosable(campaign: Campaign, *, own_model: bool) -> None:
    """Refuse driven runs that the diagnosis does not treat yet.

    Args:
        own_model: whether the nominal model is a joint of the user's own.

    Raises:
        TunnelError: for the first such run.
    """
    driven = [run for run in campaign.runs if run.drive is not None]
    for run in driven:
        assert run.drive is not None
        why = ""
        if not run.drive.on_body:
            why = "is driven by the motion of the spring's root"
        elif run.spring_stiffness == 0.0:
            why = "is driven and has no spring"
        elif own_model:
            why = "is driven, and a model of your own is given"
        elif campaign.sensor.derivative:
            why = f"is driven, and its sensor reads {campaign.sensor.quantity}s"
        elif not run.record.uniform:
            why = "is driven, and its samples are not evenly spaced"
        elif run.record.yaw_rad.size < LEAST_SAMPLES:
            raise TunnelError(
                f"the run is driven and has {run.record.yaw_rad.size} samples: too few to tell its noise from its "
                "response",
                where=f"{campaign.name}, run '{run.id}'",
                remedy=f"record {LEAST_SAMPLES} samples or more, or leave the run out",
            )
        if why:
            raise TunnelError(
                f"the run {why}, which is not diagnosed yet",
                where=f"{campaign.name}, run '{run.id}'",
                remedy="leave the run out",
            )
    mixed = {run.drive.column == "moment_nm" or run.drive.gain is not None for run in driven if run.drive}
    if len(mixed) > 1 and any(run.spring_stiffness is None for run in campaign.runs):
        raise TunnelError(
            "without spring_stiffness, inputs of known and of unknown gain cannot be diagnosed together",
            where=campaign.name,
            remedy="state spring_stiffness, or diagnose the two kinds of runs separately",
        )


def refuse_without_resonance(campaign: Campaign) -> None:
    """Refuse a driven run whose motion does not follow from its input as an oscillation.

    Raises:
        TunnelError: for the first such run.
    """
    for run in campaign.runs:
        if run.drive is not None:
            found = driven_start(run.record.time_s, run.record.yaw_rad, run.drive.values)
            if found is None or not found[1] > 0.0:
                raise TunnelError(
                    "no resonance between input and motion",
                    where=f"run {run.id}",
                    remedy="drive it over a band that includes the natural frequency; or leave the run out",
                )


def kinds_for(
    campaign: Campaign, kinds: Sequence[type[Effect]]
) -> tuple[tuple[type[Effect], ...], tuple[str, ...]]:
    """The effects that can be fitted to a campaign.

    Args:
        kinds: the effects to answer with.

    Returns:
        All of them, and no sentence, where no run is driven; else those that can be fitted to driven runs, and
        sentences that name the others.
    """
    if not campaign.driven:
        return tuple(kinds), ()
    kept = tuple(kind for kind in kinds if not (kind.line == "ringing" or kind.skips or kind is _ROD))
    gone = [kind.name for kind in kinds if kind not in kept]
    return kept, (*((_NOT_TRIED.format(", ".join(gone)),) if gone else ()), _NOT_BY_MUJOCO)


def gain_words(campaign: Campaign, fit: Fit) -> tuple[str, ...]:
    """The gain of the input in a fit.

    Args:
        campaign: as measured.
        fit: of the similar campaign.

    Returns:
        A sentence, in the measured campaign's units; none where the gain is known.
    """
    if "drive_gain" not in fit.problem.names:
        return ()
    data = fit.problem.data
    known = any(
        r.drive is not None and (r.drive.column == "moment_nm" or r.drive.gain) for r in campaign.runs
    )
    unit = "kg m2" if known else "N m"
    value, std = fit.value("drive_gain"), fit.std("drive_gain")
    value, std = (data.similarity.own(1.0, unit) ** (-1 if known else 1) * one for one in (value, std))
    if known:
        return (f"Per N m of the input the angular acceleration is {value:.5g} ± {std:.2g} rad/s².",)
    per = "rad/s²" if data.normalised else "N m"
    return (f"The gain of the input is {value:.5g} ± {std:.2g} {per} per unit.",)
