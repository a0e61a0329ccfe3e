"""Write the page of all settings of the diagnosis from their fields.

    python -m docs.studies.settings_page

writes docs/reference/settings.md; a test compares the page with the fields.
"""

from __future__ import annotations

from dataclasses import Field, fields
from pathlib import Path
from typing import Any

from diagnosis import Settings

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "settings.md"

HEAD = """\
# Settings of the diagnosis

Every number by which the diagnosis decides, with its origin. Each number belongs to one decision. `diagnose` takes
a copy with other values, and its document states the changed values under `provenance`:

```python
from diagnosis import Settings, diagnose

found = diagnose("campaign", settings=Settings().changed({"gap.detection_rate": 1e-4}))
```

*Convention*: a customary level, or the meaning of a word. *Physics*: follows from the rig. *Estimated*: fitted to
campaigns with known causes. *Tuned*: set by hand on campaigns with known causes. *Judgement*: chosen by reason
alone. [Blind tests](../blind-check.md) use other campaigns. The [ablation](../ablation.md) measures the effect of
changing the settings.

The page is written by `python -m docs.studies.settings_page`. Numerical constants (grids, iterations, tolerances of
solvers) are in the code that uses them.
"""


def page() -> str:
    """The page, in Markdown."""
    parts = [HEAD]
    for stage in fields(Settings):
        group = getattr(Settings(), stage.name)
        title = (type(group).__doc__ or "").rstrip(".")
        parts.append(f"\n## {title}\n\n| `{stage.name}.` | value | meaning | origin |\n|---|---|---|---|\n")
        parts += [_row(one) for one in fields(group)]
    return "".join(parts)


def _row(one: Field[Any]) -> str:
    about = one.metadata
    unit = "" if about["unit"] == "1" else f" {about['unit']}"
    origin = " ".join(
        filter(None, (f"{about['origin']}.".capitalize(), about["why"], _link(about["decision"])))
    )
    return f"| `{one.name}` | {one.default:g}{unit} | {about['meaning']} | {origin} |\n"


def _link(number: str) -> str:
    if not number:
        return ""
    (document,) = (ROOT / "docs" / "decisions").glob(f"{number}-*.md")
    return f"[Decision {number}](../decisions/{document.name})."


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
