"""The statistics of `identification.campaign.between_runs`, for callers above this room."""

from identification.campaign.between_runs import Marginal as Marginal
from identification.campaign.between_runs import RunProducts as RunProducts
from identification.campaign.between_runs import WidthPrior as WidthPrior
from identification.campaign.between_runs import likeliest_widths as likeliest_widths
from identification.campaign.between_runs import marginal as marginal
