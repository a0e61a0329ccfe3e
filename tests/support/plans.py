"""Plans of campaigns from their text."""

from __future__ import annotations

from pathlib import Path

from tunnel_sim.files.plan_file import load_plan
from tunnel_sim.vocabulary.plan import CampaignPlan


def planned(folder: Path, *texts: str) -> CampaignPlan:
    """A plan, read from a file of these texts."""
    path = folder / "plan.toml"
    path.write_text("".join(texts), encoding="utf-8")
    return load_plan(path)
