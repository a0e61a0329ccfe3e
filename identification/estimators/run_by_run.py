"""What estimators that identify every run by itself have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar

from identification.campaign.assembly import RunDecay, combined_estimate
from identification.campaign.derivatives import loads
from identification.estimate import Estimate
from tunnel_sim.vocabulary.campaign import Campaign, Run, SensorProperties


class RunByRun(ABC):
    """An estimator that identifies each run by itself and then combines the runs."""

    name: ClassVar[str]

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign from the runs.

        Args:
            campaign: at least one run.

        Returns:
            The estimate. A run that could not be identified is left out.

        Raises:
            TunnelError: a wind-on run states no air density; raised before any run is analysed.
        """
        for run in campaign.runs:
            loads(run, campaign.rig)
        return combined_estimate(
            campaign, self.name, [self._run(run, campaign.sensor) for run in campaign.runs]
        )

    @abstractmethod
    def _run(self, run: Run, sensor: SensorProperties) -> RunDecay:
        """Identify one run."""
