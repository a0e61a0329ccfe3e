"""The kinds of rig, and the nominal model of a campaign."""

from __future__ import annotations

from diagnosis.model.loose import LooseBody
from diagnosis.model.nominal import NominalModel
from diagnosis.model.rig import PerInertia, SpringModel
from diagnosis.model.servo import Servo, ServoPerInertia
from diagnosis.model.still_air import StillAir
from tunnel_sim.vocabulary.campaign import Campaign

#: In the order in which each kind is asked whether it describes a campaign.
KINDS: tuple[type[NominalModel], ...] = (ServoPerInertia, Servo, LooseBody, PerInertia, StillAir, SpringModel)


def nominal_model(campaign: Campaign, given: NominalModel | None = None) -> NominalModel:
    """The nominal model of a campaign: the given one, or the kind that describes its runs."""
    kind = given or next(kind for kind in KINDS if kind.describes(campaign))()
    return kind.of(campaign)
