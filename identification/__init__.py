"""Identification of free-decay campaigns, measured or simulated; MuJoCo is never imported here."""

from identification.estimate import Estimate, NoiseLevel, Quantity, RunEstimate, Status, WindowEstimate
from identification.identify import identify

__all__ = ["Estimate", "NoiseLevel", "Quantity", "RunEstimate", "Status", "WindowEstimate", "identify"]
