"""The report of a diagnosis: one self-contained HTML page, rendered from its JSON document and the records.

The names below load on first use.
"""

from typing import TYPE_CHECKING

from tunnel_sim.lazy import lazy_names

if TYPE_CHECKING:
    from tunnel_lab.report.page import (
        Byline,
        draw,
        find_browser,
        render_fit,
        render_report,
        security_policy,
        write_pdf,
        write_report,
    )
else:
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            ".page": "Byline draw find_browser render_fit render_report security_policy write_pdf write_report",
        },
    )

__all__ = [
    "Byline",
    "draw",
    "find_browser",
    "render_fit",
    "render_report",
    "security_policy",
    "write_pdf",
    "write_report",
]
