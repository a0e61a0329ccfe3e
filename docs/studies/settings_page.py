"""Write the page of all deciding numbers of the diagnosis: settings, and constants of the code.

    python -m docs.studies.settings_page

writes docs/reference/settings.md from the fields of the settings and from every ``NAME: Final = value`` of
`diagnosis`, whose docstring has the meaning, the origin and the reason; a test compares the page with them.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import Field, dataclass, fields
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any, get_args

from diagnosis import Settings
from diagnosis.settings.origin import Origin

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "settings.md"

HEAD = """\
# Settings of the diagnosis

Every number by which the diagnosis decides, with its origin. Each number belongs to one decision.

**Settings** weigh answers (a probability, a prior, a price), are the false-alarm rate of a test, or fit the
search to a campaign. `diagnose` takes a copy with other values, and its document states the changed values under
`provenance`:

```python
from diagnosis import Settings, diagnose

found = diagnose("campaign", settings=Settings().changed({"gap.detection_rate": 1e-4}))
```

**Constants** are all other numbers that decide. They are the same for every campaign and stand beside their use.

*Convention*: a customary level, or the meaning of a word. *Physics*: follows from the rig. *Estimated*: fitted to
campaigns with known causes. *Tuned*: set by hand on campaigns with known causes. *Judgement*: chosen by reason
alone. [Blind tests](../blind-check.md) use other campaigns. The [ablation](../ablation.md) measures the effect of
changing the settings.

The page is written by `python -m docs.studies.settings_page`. Numerical constants (grids, iterations, tolerances of
solvers) are in the code that uses them, without a place here.
"""

_ORIGINS = "|".join(origin.capitalize() for origin in get_args(Origin))
_SENTENCES = re.compile(rf"(.+?\.) (({_ORIGINS})( \(decision (\d{{4}})\))?\..*)")


@dataclass(frozen=True)
class Constant:
    """A deciding number of the code.

    Args:
        file: path of its file, from the root.
        value: value in the unit that its meaning states.
        said: docstring on one line, empty without one.
    """

    file: str
    name: str
    value: float
    said: str

    @property
    def sentences(self) -> tuple[str, str]:
        """Meaning and origin.

        Raises:
            ValueError: when the docstring lacks one of them.
        """
        found = _SENTENCES.fullmatch(self.said)
        if found is None:
            raise ValueError(f"{self.file}: {self.name} needs a docstring '<meaning>. <Origin>. <reason>'")
        meaning, origin, _, cited, number = found.groups()
        return meaning, origin.replace(f"{cited}.", f". {_link(number)}", 1) if cited else origin


def constants() -> Iterator[Constant]:
    """Every number of the diagnosis that is annotated as ``Final``, in the order of the files."""
    for path in sorted((ROOT / "diagnosis").rglob("*.py")):
        body = ast.parse(path.read_text("utf-8")).body
        for node, after in pairwise([*body, ast.Pass()]):
            match node:
                case ast.AnnAssign(ast.Name(name), ast.Name("Final"), ast.expr() as value):
                    said = after.value if isinstance(after, ast.Expr) else None
                    text = str(said.value) if isinstance(said, ast.Constant) else ""
                    yield Constant(
                        str(path.relative_to(ROOT)), name, ast.literal_eval(value), " ".join(text.split())
                    )


def page() -> str:
    """The page, in Markdown."""
    parts = [HEAD]
    for stage in fields(Settings):
        group = getattr(Settings(), stage.name)
        title = (type(group).__doc__ or "").rstrip(".")
        parts.append(f"\n## {title}\n\n| `{stage.name}.` | value | meaning | origin |\n|---|---|---|---|\n")
        parts += [_row(one) for one in fields(group)]
    parts.append("\n## Constants\n")
    for file, group in groupby(constants(), lambda one: one.file):
        parts.append(f"\n| `{file}` | value | meaning | origin |\n|---|---|---|---|\n")
        parts += [f"| `{one.name}` | {one.value:g} | {' | '.join(one.sentences)} |\n" for one in group]
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
