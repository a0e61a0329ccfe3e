"""The trained policy of docs/how-to/train-an-agent.md: a small network on NumPy, its features and its file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from docs.studies.policies import Action
from tunnel_lab.envs.menu import Menu, refusal
from tunnel_lab.envs.session import Knowledge
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

FEATURES = 20
LAYERS = 3
STORED = Path(__file__).parents[1] / "how-to" / "train-an-agent.safetensors"
_PAIRS = np.triu_indices(4, 1)
_SMALLEST = 1e-12  # least standard deviation: keeps its logarithm finite


def features(observation: Mapping[str, Array]) -> Array:
    """The observation of the identification preset, scaled to numbers of order one to ten, shape (20,).

    Estimate [SI], ln of its four standard deviations, their six correlations, the last run [SI], runs made and rig
    time [s].
    """
    covariance = observation["covariance"].reshape(4, 4)
    std = np.sqrt(np.maximum(np.diag(covariance), _SMALLEST**2))
    correlations = (covariance / np.outer(std, std))[_PAIRS]
    runs = observation["last_run"], observation["progress"]
    return np.concatenate((observation["estimate"], np.log(std), correlations, *runs))


@dataclass(frozen=True, eq=False)
class Agent:
    """A network and its normalisation.

    Args:
        mean: mean of the features, shape (20,).
        variance: variance of the features, shape (20,).
        layers: weights and biases, shapes (outputs, inputs) and (outputs,).
        menu: menu of the training, in the format of `menu_text`.
    """

    mean: Array
    variance: Array
    layers: tuple[tuple[Array, Array], ...]
    menu: str

    def action(self, observation: Mapping[str, Array], menu: Menu) -> Action:
        """The run that the agent chooses after an observation.

        Raises:
            TunnelError: when the menu differs from the menu of the training.
        """
        if menu_text(menu) != self.menu:
            remedy = "use the menu of the identification preset, or train an agent with yours"
            raise refusal("the agent was trained with another menu", remedy)
        spread = np.sqrt(self.variance + 1e-8)  # as in NormalizeObservation
        values = (features(observation) - self.mean) / spread
        for weight, bias in self.layers[:-1]:
            values = np.tanh(weight @ values + bias)
        weight, bias = self.layers[-1]
        parts = np.split(weight @ values + bias, np.cumsum(menu.shape)[:-1])
        spring, speed, angle, duration = (int(np.argmax(part)) for part in parts)
        return spring, speed, angle, duration

    def to_bytes(self) -> bytes:
        """As safetensors, in single precision."""
        from safetensors.numpy import save

        tensors = {"mean": self.mean, "variance": self.variance}
        for place, (weight, bias) in enumerate(self.layers):
            tensors |= {f"weight.{place}": weight, f"bias.{place}": bias}
        return save(
            {name: np.ascontiguousarray(value, dtype=np.float32) for name, value in tensors.items()},
            metadata={"menu": self.menu},
        )


def menu_text(menu: Menu) -> str:
    """A menu as one line of JSON."""
    return json.dumps(asdict(menu))


def read_agent(path: Path) -> Agent:
    """An agent from a file written by `Agent.to_bytes`."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="numpy") as file:
            names = file.keys()
            tensors: dict[str, Any] = {name: file.get_tensor(name).astype(np.float64) for name in names}
            menu = (file.metadata() or {})["menu"]
        layers = tuple((tensors[f"weight.{place}"], tensors[f"bias.{place}"]) for place in range(LAYERS))
        return Agent(tensors["mean"], tensors["variance"], layers, menu)
    except (OSError, SafetensorError, KeyError) as error:
        raise TunnelError(
            "is not an agent", where=str(path), remedy="give a file that docs/studies/campaign_agent.py wrote"
        ) from error


@cache
def stored_agent() -> Agent:
    """The agent of docs/how-to/train-an-agent.md, trained for the identification preset."""
    return read_agent(STORED)


def trained(known: Knowledge) -> Action:
    """The policy of the stored agent; for the identification preset.

    Raises:
        TunnelError: when the menu is not the menu of that preset.
    """
    return stored_agent().action(known.observation(), known.conditions.menu)
