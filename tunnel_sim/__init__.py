"""The virtual rig: its description, its MuJoCo model and plugin, and its records.

The names below load on first use: importing this package imports neither MuJoCo nor Gymnasium nor SciPy.
"""

from typing import TYPE_CHECKING

import tunnel_sim.forks  # noqa: F401  # notes what is loaded at every fork
from tunnel_sim.lazy import lazy_names
from tunnel_sim.registering import register_with_gymnasium

if TYPE_CHECKING:
    from tunnel_sim.effects import ALL_EFFECTS, Effect, effect_class, effect_from
    from tunnel_sim.engine.model import build_model, load_plugin
    from tunnel_sim.engine.simulate import simulate
    from tunnel_sim.engine.virtual_campaign import simulate_campaign, simulate_campaigns
    from tunnel_sim.files.campaign_folder import read_campaign, write_campaign
    from tunnel_sim.files.plan_file import load_plan, paper_plan
    from tunnel_sim.files.rig_file import load_rig
    from tunnel_sim.physics.run_settings import RunSettings
    from tunnel_sim.vocabulary.between_runs import Scatter
    from tunnel_sim.vocabulary.campaign import (
        Campaign,
        Repeatability,
        RigProperties,
        Run,
        SensorProperties,
    )
    from tunnel_sim.vocabulary.errors import TunnelError
    from tunnel_sim.vocabulary.plan import (
        AeroDerivatives,
        CampaignPlan,
        Condition,
        EffectSetting,
        SensorModel,
        Truth,
    )
    from tunnel_sim.vocabulary.record import Record
    from tunnel_sim.vocabulary.rig import Rig
else:
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            ".effects": "ALL_EFFECTS Effect effect_class effect_from",
            ".engine.model": "build_model load_plugin",
            ".engine.simulate": "simulate",
            ".engine.virtual_campaign": "simulate_campaign simulate_campaigns",
            ".files.campaign_folder": "read_campaign write_campaign",
            ".files.plan_file": "load_plan paper_plan",
            ".files.rig_file": "load_rig",
            ".physics.run_settings": "RunSettings",
            ".vocabulary.between_runs": "Scatter",
            ".vocabulary.campaign": "Campaign Repeatability RigProperties Run SensorProperties",
            ".vocabulary.errors": "TunnelError",
            ".vocabulary.plan": "AeroDerivatives CampaignPlan Condition EffectSetting SensorModel Truth",
            ".vocabulary.record": "Record",
            ".vocabulary.rig": "Rig",
        },
    )

register_with_gymnasium()

__all__ = [
    "ALL_EFFECTS",
    "AeroDerivatives",
    "Campaign",
    "CampaignPlan",
    "Condition",
    "Effect",
    "EffectSetting",
    "Record",
    "Repeatability",
    "Rig",
    "RigProperties",
    "Run",
    "RunSettings",
    "Scatter",
    "SensorModel",
    "SensorProperties",
    "Truth",
    "TunnelError",
    "build_model",
    "effect_class",
    "effect_from",
    "load_plan",
    "load_plugin",
    "load_rig",
    "paper_plan",
    "read_campaign",
    "simulate",
    "simulate_campaign",
    "simulate_campaigns",
    "write_campaign",
]
