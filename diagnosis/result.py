"""The result of a diagnosis, and its JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np
import polars as pl

from diagnosis.findings.cautions import CAUTIONS, NOISE, PATCH, remark, sentence_of
from diagnosis.findings.coefficients import coefficient_note
from diagnosis.findings.place import where_words
from diagnosis.findings.remainder import closable_words
from diagnosis.findings.sections import diagnosis_brief, printed
from diagnosis.findings.verdict import verdict
from diagnosis.findings.whole import Findings
from identification.estimate import as_pandas, correlated, wide_frame
from identification.show.blocks import as_notebook, as_text
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from uncertainties import UFloat


@dataclass(frozen=True)
class Diagnosis(Findings):
    """The answer for people: as text, figures, a page and tables."""

    def in_words(self) -> Diagnosis:
        """The answer with its text fields; remarks on the noise follow the examination's remarks."""
        found, model, unit = self.found, self.model, self.misfit.unit
        rest = self.rest and replace(self.rest, words=self.rest.in_words(self))
        place = where_words(self.where, found.place or found.nowhere, self)
        noted = (remark(one, unit) for one in found.noted)
        said = replace(
            self,
            verdict=verdict(self, rest.words if rest else ""),
            where=replace(self.where, words=place),
            rest=rest,
            closable=self.closable and replace(self.closable, words=closable_words(self.closable, self)),
            coefficients=replace(self.coefficients, note=coefficient_note(self.coefficients, self)),
            noise=replace(
                self.noise, reason="" if found.noise is None else sentence_of(NOISE, found.noise, unit)
            ),
            cautions=tuple(sentence_of(CAUTIONS, one, unit) for one in found.cautions),
            remarks=(*self.remarks, *(one for one in noted if one not in self.remarks)),
            model=model and replace(model, notes=tuple(sentence_of(PATCH, one) for one in model.differences)),
        )
        return self.freedom.document(said, self.names)

    def with_hashes(self, hashes: Mapping[str, str]) -> Self:
        """The answer with the SHA-256 of each file of its records, by name."""
        return replace(self, provenance={**self.provenance, "sha256": dict(hashes)})

    def __str__(self) -> str:
        """The verdict, short tables of the answers, gaps and coefficients, the caveats and the next steps."""
        return as_text(printed(self))

    def __repr__(self) -> str:
        """The answer, the gap, and the next step, in three lines."""
        return diagnosis_brief(self)

    def _repr_html_(self) -> str:
        """The text of `__str__` as HTML, for notebooks."""
        return as_notebook(printed(self))

    def plot(self, what: str = "fit", runs: Sequence[str] = ()) -> Figure:
        """Draw one figure of the report.

        Args:
            what: ``fit`` (the fit over the data) or the name of another figure, such as ``waterfall``, ``place``
                or ``repeatability``.
            runs: ids of runs for ``fit``, two are drawn; empty: the runs with the largest gap.

        Returns:
            A matplotlib figure, made without pyplot.

        Raises:
            TunnelError: for a figure or a run that this diagnosis does not have.
        """
        # the one upward import (decision 0001), here because matplotlib is slow to load
        from tunnel_lab.report import draw

        return draw(self, what, runs)

    def write_report(self, path: Path | str, *, author: str = "", notes: str = "") -> Path:
        """Write the report, one HTML page; it replaces an older page.

        Args:
            author: author of the diagnosis.
            notes: for the head of the page.

        Raises:
            TunnelError: when the page cannot be written, or the answer does not include its runs.
        """
        from tunnel_lab.report import Byline, write_report  # as in `plot`

        if self.data is None:
            remedy = "give them: tunnel_lab.report.write_report(answer, read_campaign(folder), path)"
            raise TunnelError("an answer read from a file does not hold its runs", remedy=remedy)
        today = datetime.now().astimezone().date().isoformat()
        return write_report(self, self.data, Path(path), Byline(today, author, notes))

    def to_frame(self) -> pl.DataFrame:
        """The answer in one table: a row for each size of the gap, parameter and coefficient.

        Returns:
            ``part`` (``gap``, a cause, ``before`` or ``after``), ``quantity``, ``value``, ``std``, ``unit``.
        """
        gap = self.gap
        rows: list[tuple[str, str, float, float | None, str]] = []
        for name in ("excess_before", "excess_after", "closed"):
            rows.append(("gap", name, getattr(gap, name), None, "1"))
        for name, excess in (("rms_before", gap.excess_before), ("rms_after", gap.excess_after)):
            rows.append(("gap", name, gap.misfit.rms(excess), None, gap.misfit.unit))
        first = self.candidates[0]
        for name, given in first.parameters.items():
            owner, _, parameter = name.rpartition(".")
            rows.append((owner or first.effect, parameter, given.value, given.std, given.unit))
        for part, found in (("before", self.coefficients.before), ("after", self.coefficients.after)):
            rows += [(part, name, given.value, given.std, given.unit) for name, given in found.items()]
        kinds = {"part": pl.String, "quantity": pl.String, "value": pl.Float64, "std": pl.Float64}
        return pl.DataFrame(rows, schema={**kinds, "unit": pl.String}, orient="row")

    def to_pandas(self) -> DataFrame:
        """`to_frame` for pandas; needs the extra ``frames``."""
        return as_pandas(self.to_frame())

    def to_uncertainties(self) -> dict[str, UFloat]:
        """The coefficients after the causes are added, for the package uncertainties, with their covariance.

        Estimates at a bound, or not determined by the runs, are left out.

        Raises:
            TunnelError: where uncertainties, of the extra ``frames``, is not installed.
        """
        after = self.coefficients.after
        kept = [i for i, one in enumerate(after.values()) if one.std is not None]
        values = {name: one for name, one in after.items() if one.std is not None}
        std = np.array([one.std for one in values.values()])
        correlation = np.array(self.coefficients.correlation or np.eye(len(after)))[np.ix_(kept, kept)]
        return correlated(values, correlation * np.outer(std, std))

    def candidates_frame(self) -> pl.DataFrame:
        """A row for each weighed answer: effect, probability, excess_after and closed, as in `Candidate`."""
        kinds = {"effect": pl.String, **dict.fromkeys(("probability", "excess_after", "closed"), pl.Float64)}
        rows = [{name: getattr(candidate, name) for name in kinds} for candidate in self.candidates]
        return pl.DataFrame(rows, schema=kinds)

    def parameters_frame(self) -> pl.DataFrame:
        """A row for each fitted parameter of each answer: effect, parameter, value, std, unit and bound."""
        kinds = {"effect": pl.String, "parameter": pl.String, "value": pl.Float64, "std": pl.Float64}
        rows = [
            {"effect": candidate.effect, "parameter": name, **given.to_json_dict()}
            for candidate in self.candidates
            for name, given in candidate.parameters.items()
        ]
        return pl.DataFrame(rows, schema={**kinds, "unit": pl.String, "bound": pl.String})

    def coefficients_frame(self) -> pl.DataFrame:
        """A row for each coefficient: its unit, and ``before`` and ``after`` with each ``_std``."""
        before, after = as_json(self.coefficients.before), as_json(self.coefficients.after)
        rows = []
        for name in {**before, **after}:
            both = {"before": before.get(name), "after": after.get(name)}
            rows.append({"quantity": name, "unit": (both["before"] or after[name])["unit"], **both})
        return wide_frame(rows, {"quantity": pl.String, "unit": pl.String}, ("before", "after"))

    def runs_frame(self) -> pl.DataFrame:
        """A row for each run: id, its excess before and after, and held_out, as in `RunGap`."""
        kinds = {"id": pl.String, "before": pl.Float64, "after": pl.Float64, "held_out": pl.Boolean}
        rows = [{name: getattr(run, name) for name in kinds} for run in self.gap.runs]
        return pl.DataFrame(rows, schema=kinds)
