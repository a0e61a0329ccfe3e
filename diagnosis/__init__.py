"""The diagnosis of the sim-to-real gap: where the nominal model departs, why, and the share explained.

The names below load on first use.
"""

from typing import TYPE_CHECKING

from tunnel_sim.lazy import lazy_names

if TYPE_CHECKING:
    from diagnosis._diagnose import diagnose, read_model, vocabulary
    from diagnosis.findings.candidates import Candidate
    from diagnosis.findings.closure import GapSummary, RunGap
    from diagnosis.findings.coefficients import Coefficients
    from diagnosis.result import Diagnosis
    from diagnosis.settings import Settings
    from diagnosis.where.described import Where
else:
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            "._diagnose": "diagnose read_model vocabulary",
            ".findings.candidates": "Candidate",
            ".findings.closure": "GapSummary RunGap",
            ".findings.coefficients": "Coefficients",
            ".result": "Diagnosis",
            ".settings": "Settings",
            ".where.described": "Where",
        },
    )

__all__ = [
    "Candidate",
    "Coefficients",
    "Diagnosis",
    "GapSummary",
    "RunGap",
    "Settings",
    "Where",
    "diagnose",
    "read_model",
    "vocabulary",
]
