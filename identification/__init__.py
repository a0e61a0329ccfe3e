"""Identification of free-decay campaigns, measured or simulated; MuJoCo is never imported here."""

from identification._identify import identify
from identification.estimate import Estimate, NoiseLevel, Quantity, RunEstimate, Status, WindowEstimate

__all__ = ["Estimate", "NoiseLevel", "Quantity", "RunEstimate", "Status", "WindowEstimate", "identify"]
