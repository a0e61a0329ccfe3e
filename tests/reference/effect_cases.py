"""The public vocabulary of effects, read from its page, and values at which each is seen."""

from __future__ import annotations

import re
from pathlib import Path

from tests.reference.effect_oracle import Setting
from tunnel_sim.effects import ALL_EFFECTS, BetweenRuns
from tunnel_sim.physics.run_settings import RunSettings
from tunnel_sim.vocabulary.plan import AeroDerivatives

_PAGE = Path(__file__).parents[2] / "docs" / "reference" / "effects.md"
_ROW = re.compile(r"^\| \[`(\w+)`\]\(#\w+\) \| (\w+) \| (\w+) \|", re.MULTILINE)

# name: (channel, condition), as published
VOCABULARY = {
    name: (channel, condition) for name, channel, condition in _ROW.findall(_PAGE.read_text(encoding="utf-8"))
}

# The reference simulator has free decays only. What acts on driven runs only has no form there and is compared with
# an independent integration instead (tests/conformance/test_effect_oracle.py).
ON_DRIVEN_RUNS = frozenset(kind.name for kind in ALL_EFFECTS if kind.driven)

# The reference simulator draws the scatter between runs beside the causes, not among them.
BETWEEN_RUNS = frozenset(kind.name for kind in ALL_EFFECTS if issubclass(kind, BetweenRuns))

# Values of the parameters at which the effect is seen.
VALUES = {
    kind.name: {info.name: value for info, value in zip(kind.parameters(), kind.example, strict=False)}
    for kind in ALL_EFFECTS
}


def settings(run: Setting) -> RunSettings:
    """The oracle's run as the simulator takes it."""
    from tests.reference import effect_oracle as oracle

    return RunSettings(
        run.spring,
        AeroDerivatives(oracle.CN_BETA, oracle.CN_R),
        oracle.INERTIA,
        oracle.DAMPING,
        wind_speed=run.speed,
        air_density=oracle.DENSITY,
        mean_speed=oracle.MEAN_SPEED,
        release_angle=run.release,
        duration=run.duration,
    )
