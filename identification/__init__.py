"""Identification of free-decay campaigns, measured or simulated; MuJoCo is never imported here.

The names below load on first use.
"""

from typing import TYPE_CHECKING

from tunnel_sim.lazy import lazy_names

if TYPE_CHECKING:
    from identification.checking import check_estimator
    from identification.datasets import (
        MEASURED_CAMPAIGNS,
        measured_campaign,
        paper_derivatives,
        paper_springs,
        paper_windows,
    )
    from identification.estimate import Estimate, NoiseLevel, RunEstimate, WindowEstimate
    from identification.estimators import ALL_ESTIMATORS, Estimator, make_estimator, register_estimator
    from identification.identifying import identify
    from identification.show.quantity import Quantity
    from identification.status import Remark, Status
else:
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            ".identifying": "identify",
            ".checking": "check_estimator",
            ".datasets": "MEASURED_CAMPAIGNS measured_campaign paper_derivatives paper_springs paper_windows",
            ".estimate": "Estimate NoiseLevel Quantity RunEstimate WindowEstimate",
            ".estimators": "ALL_ESTIMATORS Estimator make_estimator register_estimator",
            ".status": "Remark Status",
        },
    )

__all__ = [
    "ALL_ESTIMATORS",
    "MEASURED_CAMPAIGNS",
    "Estimate",
    "Estimator",
    "NoiseLevel",
    "Quantity",
    "Remark",
    "RunEstimate",
    "Status",
    "WindowEstimate",
    "check_estimator",
    "identify",
    "make_estimator",
    "measured_campaign",
    "paper_derivatives",
    "paper_springs",
    "paper_windows",
    "register_estimator",
]
