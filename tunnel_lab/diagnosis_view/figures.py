"""All figures of a diagnosis, by name."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tunnel_lab.diagnosis_view import figures_answer as answer
from tunnel_lab.diagnosis_view import figures_where as where
from tunnel_lab.diagnosis_view.figures_backbone import backbone_figure
from tunnel_lab.diagnosis_view.figures_common import Document
from tunnel_lab.diagnosis_view.figures_law import law_figure
from tunnel_lab.diagnosis_view.figures_waterfall import waterfall_figure
from tunnel_sim.vocabulary.campaign import Campaign

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def diagnosis_figures(document: Document, campaign: Campaign) -> dict[str, Figure]:
    """All figures of a diagnosis.

    Args:
        document: the diagnosis as JSON's types; without ``maps`` those that need them are left out.

    Returns:
        Figures by name, in the order of the report.
    """
    found: dict[str, Figure | None] = {"waterfall": waterfall_figure(document)}
    if document.get("maps"):
        found["where-runs"] = where.runs_figure(document)
        found["where-profiles"] = where.profiles_figure(document)
        found["where-spectrum"] = where.spectrum_figure(document)
        found["where-backbones"] = backbone_figure(document)
        found["where-phase-plane"] = where.phase_plane_figure(document)
        found["where-moment"] = where.moment_figure(document)
    found["which"] = answer.candidates_figure(document)
    found["how-far"] = answer.closure_figure(document)
    if document.get("maps"):
        found["residuals"] = answer.traces_figure(document, campaign)
    found["law"] = law_figure(document)
    found["coefficients"] = answer.coefficients_figure(document)
    return {name: figure for name, figure in found.items() if figure is not None}
