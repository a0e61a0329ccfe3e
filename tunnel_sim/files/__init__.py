"""Reading and writing of campaigns, run files, plans and rigs. Input is checked; output is written atomically.

The name below loads on first use.
"""

from typing import TYPE_CHECKING

from tunnel_sim.lazy import lazy_names

if TYPE_CHECKING:
    from tunnel_sim.files.importing.records import import_records
else:
    __getattr__, __dir__ = lazy_names(__name__, {".importing.records": "import_records"})

__all__ = ["import_records"]
