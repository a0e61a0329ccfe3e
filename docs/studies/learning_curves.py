"""The amount of training for the environments, measured by ``python -m docs.studies.learning_curves docs``.

Agents are trained with Stable-Baselines3 on one thread. At intervals the current agent plays a fixed set of
episodes, not used in training, with its most probable actions. The score of an episode is its return, in nats.
Data, figure and table of docs/how-to/train-an-agent.md are written. Training needs the extra ``train`` and some
fifteen minutes of one core; ``--draw`` draws the stored data.
"""

from __future__ import annotations

import argparse
import csv
import io
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.wrappers.vector import NormalizeObservation

import tunnel_sim.envs  # noqa: F401  registers the environments
from docs.studies.campaign_agent import CAMPAIGNS, TRAINING, make, model_of
from docs.studies.page_text import replaced
from docs.studies.policies import greedy, scripted
from docs.studies.resonant import Resonant
from docs.studies.trained_policy import features, trained
from identification.show.quantity import INTERVAL
from identification.show.style import COLOURS, MARKERS, WIDTH, figure, grid, save, styled
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.record import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FREE_DECAY: dict[str, Any] = {
    "duration": 10.0,
    "control_period": 0.05,
    "sample_rate": 100.0,
    "noise_std": 0.005,
    "prior": {"cn_beta": 0.03, "cn_r": 0.03},
}
"""A run of 200 control periods, with some seven in a cycle; by default it has 1000. The derivatives are known
to 0.03 from an earlier campaign. With the default prior, which is very wide, the first half second gives most
of the reward whatever the agent does, and hides the contribution of its actions."""
SETTINGS: dict[str, Any] = {
    "n_steps": 200,  # one run
    "batch_size": 400,
    "gamma": 0.98,  # 50 control periods, 2.5 s: the wind follows its set-point in 2 s
    "ent_coef": 0.0,
    "learning_rate": 1e-3,
    "policy_kwargs": {"net_arch": [64, 64], "log_std_init": -0.5},
}
"""Settings of PPO for ``FreeDecay-v0`` that differ from the stored agent's."""
RUNS = 16  # number of runs in parallel
SEEDS = (0, 1)
SWING = radians(20.0)  # rad, amplitude of the hand-written policy
SPEEDS = (
    25.0,
    40.0,
)  # m/s, wind speeds of the hand-written policy; the second is the limit, which the agent has too
SHARE = 0.5  # share of the spring's stiffness that the air may take at the speed chosen for the spring
CURVES = ("FreeDecay-v0", "Campaign-v0")
LENGTHS = {"FreeDecay-v0": 150_000, "Campaign-v0": 32_000}
"""Steps of each training: control periods, and runs."""
STEP = {"FreeDecay-v0": "control periods", "Campaign-v0": "runs"}
EPISODES = {"FreeDecay-v0": 48, "Campaign-v0": 50}
TRAINED = "trained"
STORED = "stored agent"
NAME = "train-an-agent-curves"


@dataclass(frozen=True)
class Point:
    """The score of a policy, or of an agent at one point of its training.

    Args:
        policy: ``trained``, or a policy for comparison.
        seed: seed of the training; 0 for a policy for comparison.
        steps: steps of the training so far; 0 for a policy for comparison.
        nats: mean return of the episodes, nats.
        std_error: standard error of the mean, from the scatter between the episodes, nats.
        episodes: number of episodes.
    """

    environment: str
    policy: str
    seed: int
    steps: int
    nats: float
    std_error: float
    episodes: int


def point(environment: str, policy: str, seed: int, steps: int, returns: Array) -> Point:
    """The mean of returns, shape (n,), nats."""
    error = float(returns.std(ddof=1) / np.sqrt(returns.size))
    return Point(
        environment, policy, seed, steps, round(float(returns.mean()), 4), round(error, 4), returns.size
    )


def play_runs(act: Callable[[Array], Array], begin: Callable[[dict[str, Any]], None] | None = None) -> Array:
    """The returns of runs of ``FreeDecay-v0``, nats, shape (n,).

    Args:
        act: function from observations, shape (n, p), to actions, shape (n, 2).
        begin: function called with the stated conditions, each of shape (n,).
    """
    count = EPISODES["FreeDecay-v0"]
    envs = gymnasium.make_vec("tunnel_sim/FreeDecay-v0", num_envs=count, nthread=1, **FREE_DECAY)
    observations, info = envs.reset(seed=0)
    if begin is not None:
        begin(info)
    returns, over = np.zeros(count), np.zeros(count, dtype=bool)
    while not over.all():
        observations, rewards, terminated, truncated, _ = envs.step(act(observations))
        returns += np.where(over, 0.0, rewards)  # a finished run restarts automatically
        over |= terminated | truncated
    envs.close()
    return returns


def play_campaigns(act: Callable[[Any], Any]) -> Array:
    """The returns of campaigns of ``Campaign-v0``, nats less rig time, shape (n,).

    Args:
        act: function that gives the action in an environment during an episode.
    """
    env = gymnasium.make("tunnel_sim/Campaign-v0")
    returns = np.zeros(EPISODES["Campaign-v0"])
    for seed in range(returns.size):
        env.reset(seed=seed)
        over = False
        while not over:
            _, reward, terminated, truncated, _ = env.step(np.array(act(env.unwrapped)))
            returns[seed] += float(reward)
            over = terminated or truncated
    return returns


@dataclass(frozen=True, eq=False)
class _Held:
    """One action throughout."""

    action: Array

    def __call__(self, _: Array) -> Array:
        return self.action


def untrained() -> list[Point]:
    """The policies for comparison with the agents."""
    from tunnel_sim.envs.engines import operator_action
    from tunnel_sim.envs.episode_conditions import CN_BETA, FreeDecayConfig

    config, points = FreeDecayConfig(**FREE_DECAY), []
    rig = config.rig()
    policies: list[Callable[[Array], Array]] = []

    def alone(info: dict[str, Any]) -> None:
        policies[:] = [
            _Held(operator_action(config, wind_speed=float(speed))) for speed in info["wind_speed"]
        ]

    def resonant(info: dict[str, Any], speed: float) -> None:
        policies[:] = [
            Resonant(config, stiffness=float(spring), inertia=0.1014, wind_speed=speed, amplitude=SWING)
            for spring in info["spring_stiffness"]
        ]

    def by_spring(info: dict[str, Any]) -> None:
        air = (
            0.5 * rig.air.density * rig.body.frontal_area * rig.body.length * max(CN_BETA)
        )  # N m s²/(rad m²)
        policies[:] = []
        for spring in info["spring_stiffness"].tolist():
            speed = min((SHARE * spring / air) ** 0.5, config.wind_limit)
            policies.append(
                Resonant(config, stiffness=spring, inertia=0.1014, wind_speed=speed, amplitude=SWING)
            )

    def each(observations: Array) -> Array:
        return np.array([policy(own) for policy, own in zip(policies, observations, strict=True)])

    driven = [(f"resonant at {speed:g} m/s", partial(resonant, speed=speed)) for speed in SPEEDS]
    rules: list[tuple[str, Callable[[dict[str, Any]], None]]]
    rules = [("free decay", alone), *driven, ("resonant by spring", by_spring)]
    for name, begin in rules:
        points.append(point("FreeDecay-v0", name, 0, 0, play_runs(each, begin)))
    for name, rule in (("scripted", scripted), ("greedy", greedy), (STORED, trained)):
        returns = play_campaigns(lambda env: rule(env.known))  # noqa: B023  called within the loop
        points.append(point("Campaign-v0", name, 0, 0, returns))
    return points


def train(environment: str, seed: int, steps: int) -> list[Point]:
    """The learning curve of one agent, from before its training to its end."""
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    torch.set_num_threads(1)  # the network is so small that a second thread only costs time
    if environment == "FreeDecay-v0":
        native = gymnasium.make_vec("tunnel_sim/FreeDecay-v0", num_envs=RUNS, nthread=1, **FREE_DECAY)
        envs = NormalizeObservation(native)
        model = model_of(envs, seed, **SETTINGS)
    else:
        envs = make(CAMPAIGNS, **TRAINING)
        model = model_of(envs, seed)

    def returns() -> Array:
        statistics: Any = envs.obs_rms
        mean, spread = statistics.mean.copy(), np.sqrt(statistics.var + envs.epsilon)

        def act(observation: Array) -> Array:
            action: Array = model.predict((observation - mean) / spread, deterministic=True)[0]
            return action

        if environment == "FreeDecay-v0":
            return play_runs(act)
        return play_campaigns(lambda env: act(features_of(env)))

    points: list[Point] = []

    class Score(BaseCallback):
        """Scores the agent before a rollout whenever the number of steps has doubled."""

        next_steps = 0

        def _on_rollout_start(self) -> None:
            if self.num_timesteps >= self.next_steps:
                points.append(point(environment, TRAINED, seed, self.num_timesteps, returns()))
                print(points[-1], flush=True)
                self.next_steps = max(2 * self.num_timesteps, 1)

        def _on_step(self) -> bool:
            return True

    model.learn(steps, callback=Score())
    if points[-1].steps < model.num_timesteps:
        points.append(point(environment, TRAINED, seed, model.num_timesteps, returns()))
    return points


def features_of(env: Any) -> Array:
    """The features for the agent of a campaign."""
    return features(env.known.observation())


def to_csv(points: Sequence[Point]) -> str:
    """The points as CSV, a row for each."""
    text = io.StringIO()
    writer = csv.DictWriter(text, [item.name for item in fields(Point)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(asdict(score) for score in points)
    return text.getvalue()


def from_csv(text: str) -> list[Point]:
    """The inverse of `to_csv`."""
    return [
        Point(
            row["environment"],
            row["policy"],
            int(row["seed"]),
            int(row["steps"]),
            float(row["nats"]),
            float(row["std_error"]),
            int(row["episodes"]),
        )
        for row in csv.DictReader(io.StringIO(text))
    ]


@styled
def curves(points: Sequence[Point]) -> Figure:
    """The scores over the steps of the training with 95 % intervals, a panel for each environment."""
    drawn = figure(WIDTH, 3.6)
    for axes, environment in zip(drawn.subplots(1, len(CURVES)), CURVES, strict=True):
        _panel(axes, [score for score in points if score.environment == environment])
        axes.set_title(environment)
        axes.set_xlabel(f"steps of the training: {STEP[environment]}")
    drawn.axes[0].set_ylabel("information in a run [nats]")
    drawn.axes[1].set_ylabel("information less rig time [nats]")
    return drawn


def _panel(axes: Axes, points: Sequence[Point]) -> None:
    mine = [score for score in points if score.policy == TRAINED]
    first = min(score.steps for score in mine if score.steps)
    start = first / 2.0  # position of zero on the logarithmic axis
    for place, seed in enumerate(sorted({score.seed for score in mine})):
        line = [score for score in mine if score.seed == seed]
        axes.errorbar(
            [max(score.steps, start) for score in line], [score.nats for score in line],
            yerr=[INTERVAL * score.std_error for score in line],
            color=COLOURS[place], marker=MARKERS[place], markersize=4.0, linewidth=1.0,
            label=f"agent, seed {seed}",
        )  # fmt: skip
    for place, rule in enumerate(score for score in points if score.policy != TRAINED):
        style = ("--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))[place]
        axes.axhline(rule.nats, color="0.4", linewidth=1.0, linestyle=style, label=rule.policy)
    last = max(score.steps for score in mine)
    marks = [mark for mark in (3e3, 1e4, 3e4, 1e5) if first <= mark <= last]
    axes.set_xscale("log")
    axes.set_xlim(0.8 * start, 1.2 * last)
    axes.set_xticks([start, *marks], ["0", *(f"{mark:,.0f}" for mark in marks)])
    axes.minorticks_off()
    grid(axes)
    axes.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.2), ncols=2)


def fill(page: str, points: Sequence[Point]) -> str:
    """The page with the table of the scores over the steps, for each environment."""
    for environment in CURVES:
        mine = [score for score in points if score.environment == environment]
        seeds = sorted({score.seed for score in mine if score.policy == TRAINED})
        lines = [
            f"| {STEP[environment]} | {' | '.join(f'agent, seed {seed} [nats]' for seed in seeds)} |",
            "|---" * (1 + len(seeds)) + "|",
        ]
        for steps in sorted({score.steps for score in mine if score.policy == TRAINED}):
            scores = {score.seed: score for score in mine if (score.policy, score.steps) == (TRAINED, steps)}
            lines.append(f"| {steps:,} | {' | '.join(_cell(scores[seed]) for seed in seeds)} |")
        for score in mine:
            if score.policy != TRAINED:
                lines.append(f"| *{score.policy}* | {' | '.join([_cell(score)] + [''] * (len(seeds) - 1))} |")
        page = replaced(page, environment, "\n".join(lines))
    return page


def _cell(score: Point) -> str:
    return f"{score.nats:.2f} ± {INTERVAL * score.std_error:.2f}".replace("-", "−")


def main(arguments: Sequence[str] | None = None) -> int:
    """Train, and write the data and the figure; or draw the stored data."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("docs", type=Path, help="the folder docs of the source tree")
    parser.add_argument("--draw", action="store_true", help="draw the stored data; train nothing")
    given = parser.parse_args(arguments)
    stored = given.docs / "how-to" / f"{NAME}.csv"
    if not given.draw:
        points = untrained()
        for environment in CURVES:
            for seed in SEEDS:
                points += train(environment, seed, LENGTHS[environment])
        write_whole(stored, to_csv(points).encode())
    points = from_csv(stored.read_text(encoding="utf-8"))
    save(curves(points), given.docs / "images" / f"{NAME}.png")
    page = given.docs / "how-to" / "train-an-agent.md"
    write_whole(page, fill(page.read_text(encoding="utf-8"), points).encode())
    return 0


if __name__ == "__main__":
    sys.exit(main())
