"""A trained policy for ``Campaign-v0`` as a small network, evaluated with NumPy; docs/how-to/train-an-agent.md.

The network takes the normalised `features` of the observation through two hidden layers of tanh and has one output
for each entry of the menu. The policy takes the largest output of each part of the action.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from tunnel_lab.envs.menu import Menu
from tunnel_lab.envs.session import Knowledge
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Array

FEATURES = 20
LAYERS = 3
PACKAGED = "campaign-agent.safetensors"
_PAIRS = np.triu_indices(4, 1)
_SMALLEST = 1e-12  # of a standard deviation, so that its logarithm is finite


def features(observation: Mapping[str, Array]) -> Array:
    """The observation of the identification preset in numbers of order one to ten.

    Args:
        observation: of ``Campaign-v0``.

    Returns:
        Estimate [SI], ln of its four standard deviations, their six correlations, the last run [SI], runs made and
        rig time [s]; shape (20,).
    """
    covariance = observation["covariance"].reshape(4, 4)
    std = np.sqrt(np.maximum(np.diag(covariance), _SMALLEST**2))
    correlations = (covariance / np.outer(std, std))[_PAIRS]
    parts = (
        observation["estimate"],
        np.log(std),
        correlations,
        observation["last_run"],
        observation["progress"],
    )
    return np.concatenate(parts)


@dataclass(frozen=True, eq=False)
class Agent:
    """A network and its normalisation.

    Args:
        mean: of the features, shape (20,).
        variance: of the features, shape (20,).
        layers: weights and biases, shapes (outputs, inputs) and (outputs,).
        menu: as `menu_text` writes it: that of the training.
    """

    mean: Array
    variance: Array
    layers: tuple[tuple[Array, Array], ...]
    menu: str

    def action(self, observation: Mapping[str, Array], menu: Menu) -> tuple[int, int, int, int]:
        """The run that the agent chooses.

        Args:
            observation: of ``Campaign-v0``.

        Raises:
            TunnelError: when the menu is not that of the training.
        """
        if menu_text(menu) != self.menu:
            raise TunnelError(
                "the agent was trained with another menu",
                where="Campaign-v0",
                remedy="use the menu of the identification preset, or train an agent with yours",
            )
        values = (features(observation) - self.mean) / np.sqrt(
            self.variance + 1e-8
        )  # as NormalizeObservation
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
    """An agent from a file that `Agent.to_bytes` made.

    Raises:
        TunnelError: when the file cannot be read or is not an agent.
    """
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
def packaged_agent() -> Agent:
    """The agent in the package, trained for the identification preset."""
    with resources.as_file(resources.files("tunnel_lab") / "data" / PACKAGED) as path:
        return read_agent(path)


def trained(known: Knowledge) -> tuple[int, int, int, int]:
    """The policy of the packaged agent; for the identification preset.

    Raises:
        TunnelError: when the menu is not that preset's.
    """
    return packaged_agent().action(known.observation(), known.conditions.menu)
