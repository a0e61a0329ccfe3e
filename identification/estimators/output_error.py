"""Output error: maximum likelihood of the motion, for each run and jointly for the campaign.

The fits of the runs (ωn, ζ, initial state, zero) start the joint fit, in which Izz, Cr, Cnβ, Cnr and the sensor's
zero are common. Runs that scatter are combined with their scatter instead. Sources: the equation of motion (2)–(6)
of the paper; Jategaonkar, Flight Vehicle System Identification, 2nd ed. (2015), ch. 4, doi 10.2514/4.102790.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from identification.campaign.combination import scattering_estimate
from identification.campaign.derivatives import loads, statuses_of_runs
from identification.campaign.joint import joint_estimate
from identification.campaign.linked_runs import LinkedRuns
from identification.estimate import Estimate, Status, by_severity
from identification.progress import counted
from identification.signal.run_fit import identify_run
from tunnel_sim.vocabulary.campaign import Campaign


@dataclass(frozen=True)
class OutputError:
    """Maximum likelihood with white measurement noise and no process noise.

    Args:
        cycles_per_window: periods in each window of a run; None: three, or one in a record of fewer than twelve
            cycles.
    """

    name: ClassVar[str] = "output_error"
    takes_driven: ClassVar[bool] = True
    cycles_per_window: int | None = None

    def estimate(self, campaign: Campaign) -> Estimate:
        """Identify every run, then the campaign, without runs that lack a result or a spring stiffness.

        Raises:
            TunnelError: when a wind-on run states no air density.
        """
        for run in campaign.runs:
            loads(run, campaign.rig)  # a wind-on run without density is refused before the fits
        fitted = [
            identify_run(run, campaign.sensor, cycles_per_window=self.cycles_per_window)
            for run in counted(campaign.runs)
        ]
        estimate = Estimate(campaign.name, self.name, tuple(item.estimate for item in fitted))
        statuses = statuses_of_runs(campaign, estimate.runs)
        if Status.NO_RUN_IDENTIFIED in statuses:
            return replace(estimate, statuses=by_severity(statuses))
        linked = LinkedRuns.of(campaign, [item.gained for item in fitted])
        scattering = scattering_estimate(linked, self.name, fitted)
        return scattering or joint_estimate(linked, estimate, fitted, statuses)
