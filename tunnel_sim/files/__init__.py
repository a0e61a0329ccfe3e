"""Reading and writing of campaigns, run files, plans and rigs. Input is checked; output is written atomically.

The names below load on first use.
"""

from typing import TYPE_CHECKING

from tunnel_sim.lazy import lazy_names

if TYPE_CHECKING:
    from tunnel_sim.files.importing.choices import ImportChoices
    from tunnel_sim.files.importing.condition_names import Conditions
    from tunnel_sim.files.importing.writing import import_records
else:
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            ".importing.choices": "ImportChoices",
            ".importing.condition_names": "Conditions",
            ".importing.writing": "import_records",
        },
    )

__all__ = ["Conditions", "ImportChoices", "import_records"]
