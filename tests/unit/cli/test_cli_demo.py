"""Parts of ``tunnel demo`` on a campaign smaller than the paper's."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from identification import Status
from tunnel_lab.commands.paper import SHOWN, show_simulated, simulated_part
from tunnel_sim.files.plan_file import load_plan

TINY = Path(__file__).parents[2] / "data" / "tiny-plan.toml"


def test_every_estimator_of_the_comparison_is_kept_and_shown(tmp_path: Path, capsys) -> None:
    plan = load_plan(TINY)
    campaign, estimates = simulated_part(plan, tmp_path)
    assert sorted(path.stem for path in tmp_path.glob("*.json")) == sorted(f"estimate-{n}" for n in SHOWN)
    show_simulated(campaign, [replace(estimates[0], statuses=(Status.MODEL_DEPARTS,)), *estimates[1:]], plan)
    shown = capsys.readouterr().out.splitlines()
    assert [line.strip() for line in shown if line.strip() in SHOWN] == list(SHOWN)
    assert [line for line in shown if line.startswith("Note")] == [
        f"Note, {SHOWN[0]}: {Status.MODEL_DEPARTS.value}"
    ]
