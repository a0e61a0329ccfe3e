"""The report of a diagnosis: one self-contained HTML page, rendered from its JSON document and the records."""

from tunnel_lab.diagnosis_view.page import Byline, render_report, write_report

__all__ = ["Byline", "render_report", "write_report"]
