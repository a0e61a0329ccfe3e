"""Train an agent for ``Campaign-v0`` with Stable-Baselines3, and score it; docs/how-to/train-an-agent.md.

``python -m docs.studies.campaign_agent train OUT.safetensors`` trains on one thread, in linear theory.
``python -m docs.studies.campaign_agent score docs`` plays 50 campaigns in the full simulation and writes the page's
table; ``--agent FILE --seed N`` adds a row for another agent, trained from seed N. Training needs the extra
``train``; the score does not.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.wrappers.vector import NormalizeObservation

import tunnel_sim.envs  # noqa: F401  registers the environments
from docs.studies.campaign_policies import Row, from_csv, play_all, table, to_csv
from docs.studies.page_text import replaced
from docs.studies.policies import Action
from docs.studies.trained_policy import (
    FEATURES,
    LAYERS,
    Agent,
    features,
    menu_text,
    read_agent,
    stored_agent,
)
from tunnel_lab.envs.campaign import CampaignEnv
from tunnel_lab.envs.session import Knowledge
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.errors import TunnelError

TRAINED_FROM = 1_000_000  # first seed of the training, far from the seeds of the score
STEPS = 90_000
CAMPAIGNS = 16  # number of campaigns in parallel: one evaluation of the network for all
TRAINING: dict[str, Any] = {"sample_rate": 25.0, "noise_std": 0.025, "max_runs": 12}
"""A quarter of the samples with half the noise contain the same information and take a quarter of the time.
Campaigns of an untrained agent are cut off earlier."""


def make(count: int, **arguments: Any) -> NormalizeObservation:
    """Campaigns in parallel with the agent's features, normalised by Gymnasium's wrapper.

    Args:
        count: number of campaigns.
        **arguments: arguments of ``Campaign-v0``.
    """
    space = gymnasium.spaces.Box(-np.inf, np.inf, (FEATURES,), np.float64)

    def one() -> Any:
        env = gymnasium.make("tunnel_sim/Campaign-v0", **arguments)
        return gymnasium.wrappers.TransformObservation(env, features, space)

    return NormalizeObservation(gymnasium.vector.SyncVectorEnv([one] * count))


def model_of(envs: NormalizeObservation, seed: int, **changes: Any) -> Any:
    """Stable-Baselines3's PPO with the settings of the stored agent.

    Args:
        envs: normalised parallel campaigns.
        seed: seed of network and environments.
        **changes: other settings.
    """
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecMonitor

    from docs.studies.stable_baselines import BaselinesVecEnv

    settings: dict[str, Any] = {
        "n_steps": 128,
        "batch_size": 256,
        "n_epochs": 10,
        "learning_rate": lambda left: 1e-3 * (0.25 + 0.75 * left),
        "gamma": 1.0,  # an episode ends within 12 runs
        "gae_lambda": 0.95,
        "ent_coef": 0.005,
        "policy_kwargs": {"net_arch": [64, 64]},
        "seed": TRAINED_FROM + seed,
        "device": "cpu",
    }
    return PPO("MlpPolicy", VecMonitor(BaselinesVecEnv(envs)), **settings | changes)


def train(steps: int, seed: int) -> Agent:
    """Train by proximal policy optimisation (Schulman et al., arXiv 1707.06347).

    Args:
        steps: total number of runs.
    """
    import torch

    torch.set_num_threads(1)  # a second thread only costs time for so small a network
    envs = make(CAMPAIGNS, **TRAINING)
    model = model_of(envs, seed, verbose=1)
    model.learn(steps)
    parts = (*model.policy.mlp_extractor.policy_net, model.policy.action_net)
    linear = [part for part in parts if hasattr(part, "weight")]
    layers = tuple((part.weight.detach().numpy(), part.bias.detach().numpy()) for part in linear)
    assert len(layers) == LAYERS
    menu = CampaignEnv(**TRAINING).conditions.menu
    return Agent(envs.obs_rms.mean, envs.obs_rms.var, layers, menu_text(menu))


def score(agent: Agent, name: str = "trained") -> list[Row]:
    """Play the seeds of the score with an agent in the full simulation.

    Args:
        name: name of the policy in the rows.
    """
    return play_all("identification", name, partial(_action, agent))


def _action(agent: Agent, known: Knowledge) -> Action:
    return agent.action(known.observation(), known.conditions.menu)


def write_score(docs: Path, rows: Sequence[Row]) -> None:
    """Add the episodes to the CSV of all agents, and fill the page's table.

    Args:
        docs: the folder docs of the source tree.
        rows: rows of one agent.
    """
    stored = docs / "how-to" / "train-an-agent.csv"
    kept = [one for one in from_csv(stored.read_text(encoding="utf-8")) if one.policy != rows[0].policy]
    every = sorted((*kept, *rows), key=lambda one: (one.policy, one.seed))
    write_whole(stored, to_csv(every).encode())
    page = docs / "how-to" / "train-an-agent.md"
    write_whole(page, fill(page.read_text(encoding="utf-8"), docs).encode())


def fill(page: str, docs: Path) -> str:
    """The page with the table of the stored episodes of all policies."""
    stored = (docs / "campaign-design.csv", docs / "how-to" / "train-an-agent.csv")
    rows = [row for file in stored for row in from_csv(file.read_text(encoding="utf-8"))]
    agents = sorted({row.policy for row in rows if row.policy.startswith("trained")})
    return replaced(page, "score", table(rows, "identification", ("scripted", "greedy", *agents)))


def main(arguments: Sequence[str] | None = None) -> int:
    """Train or score."""
    parser = argparse.ArgumentParser(description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    training = commands.add_parser("train", help="train an agent and write it")
    training.add_argument("out", type=Path, help="file to write (.safetensors)")
    training.add_argument("--steps", type=int, default=STEPS, help="runs to make")
    training.add_argument("--seed", type=int, default=0, help="of network and environment")
    scoring = commands.add_parser("score", help="score an agent in the full simulation")
    scoring.add_argument("docs", type=Path, help="the folder docs of the source tree")
    scoring.add_argument("--agent", type=Path, help="its file; the stored agent where left out")
    scoring.add_argument("--seed", type=int, default=1, help="of the training of --agent, for the table")
    given = parser.parse_args(arguments)
    if given.command == "train":
        write_whole(given.out, train(given.steps, given.seed).to_bytes())
        return 0
    try:
        agent = stored_agent() if given.agent is None else read_agent(given.agent)
    except TunnelError as error:
        print(error, file=sys.stderr)
        return 2
    write_score(given.docs, score(agent, "trained" if given.agent is None else f"trained, seed {given.seed}"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
