"""Families of effects that samples for training treat apart, because of what one record shows of them."""

from __future__ import annotations

from collections.abc import Mapping

ROD = "rod_flexibility"
"""Simulated in closed form, alone: its own oscillation is too fast for the steps."""

LINEAR_IN_A_RECORD = frozenset(
    {
        "structural_damping",
        "gravity_stiffness",
        ROD,
        "unsteady_aero_lag",
        "spring_miscalibration",
        "wind_speed_offset",
        "wind_speed_drift",
    }
)
"""One record of these is another damped oscillation: what it shows is its own decay, not that of the stated rig."""

LOST_SAMPLES: Mapping[str, int] = {"dropped_samples/one_instant": 1, "dropped_samples/three_instants": 3}
"""Least number of samples that a form loses, by family and name."""
