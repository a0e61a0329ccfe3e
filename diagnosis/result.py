"""The result of a diagnosis, and its JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import polars as pl
from pydantic import TypeAdapter

from diagnosis.facts.closure import Confirmation, Misfit, NoiseSummary, Waterfall
from diagnosis.facts.decision import Decision
from diagnosis.facts.disturbance import Disturbance
from diagnosis.facts.found import Found
from diagnosis.facts.patch import PatchedModel
from diagnosis.facts.reading import UNWRITTEN, from_json_fields
from diagnosis.facts.remainder import Closable, Remainder
from diagnosis.facts.repeatability import RunRepeatability
from diagnosis.words.lines import diagnosis_brief
from diagnosis.words.sections import printed
from diagnosis.words.written import sentences
from identification.blocks import as_notebook, as_text
from identification.estimate import Quantity, as_pandas, correlated, wide_frame
from identification.status import Remark
from identification.trade_off import TradeOff
from tunnel_sim.files.reading import as_described, check_shape
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame
    from uncertainties import UFloat

SCHEMA_VERSION = 1
_LAST = (
    "sizes", "rest", "model", "closable", "ambiguous_with", "next_run", "coefficients", "confirmation", "noise",
    "hidden", "trade_off", "blind_spots", "cautions", "repeatability", "disturbed", "remarks", "found", "seconds",
    "maps", "provenance",
)  # fmt: skip


@dataclass(frozen=True)
class RunGap:
    """A run's excess before and after the causes are added.

    Args:
        before: ratio of mean squared residual to noise variance, minus one, of the nominal model, predicted from
            the other runs where the run could be held out.
        after: the same ratio minus one with the causes added.
        held_out: whether the run could be held out; else both are those of the fits of all runs.
    """

    id: str
    before: float
    after: float
    held_out: bool = True


@dataclass(frozen=True)
class GapSummary:
    """The gap of the campaign.

    Args:
        excess_before: of the nominal model, in units of the noise variance, on held-out readings; where
            nothing is found, in the fitted runs.
        excess_after: with the causes added, on the same readings, in units of the noise variance.
        closed: share of the gap that is closed, 0 to 1.
        closed_on: the readings on which these are measured (`diagnosis.facts.closure`).
        false_alarm_rate: of the test of detection, a fraction of the campaigns without a gap.
        p_value: of the strongest test, corrected for the number of tests.
        tests: p-value by name of test.
        closed_ahead: share of the gap in the later half of driven runs that the causes explain, fitted to the
            earlier half; None where runs are held out whole, or are not driven.
    """

    detected: bool
    excess_before: float
    excess_after: float
    closed: float
    closed_on: str
    runs: tuple[RunGap, ...]
    false_alarm_rate: float
    p_value: float
    tests: Mapping[str, float] = field(default_factory=dict)
    misfit: Misfit | None = None
    closed_ahead: float | None = None

    def to_json_dict(self) -> dict[str, Any]:
        """Fields by name, and in ``misfit`` those of `Misfit` and the root mean squares before and after."""
        found = {name: as_json(getattr(self, name)) for name in self.__dataclass_fields__}
        if self.misfit is not None:
            before, after = self.misfit.rms(self.excess_before), self.misfit.rms(self.excess_after)
            found["misfit"] |= {"before": before, "after": after}
        return found


@dataclass(frozen=True)
class Where:
    """The place of the gap.

    Args:
        channel: ``stiffness``, ``damping``, ``forcing``, ``sensor`` or ``calibration``; None: nowhere.
        condition: ``always`` or ``wind_on``; None: nowhere.
        time_s: time in the runs at which most of it occurs, s.
        amplitude_rad: amplitudes at which most of it lies, rad.
        frequency_hz: frequencies at which most of it lies, Hz.
    """

    channel: str | None
    condition: str | None
    runs: tuple[str, ...] = ()
    time_s: tuple[float, float] | None = None
    amplitude_rad: tuple[float, float] | None = None
    frequency_hz: tuple[float, float] | None = None
    words: str = ""


@dataclass(frozen=True)
class Candidate:
    """An answer that was considered.

    Args:
        effect: name, ``none`` or ``unknown``; several names are joined by a plus sign.
        probability: that it is the answer, a fraction.
        excess_after: with it added, in the fitted runs, in units of the noise variance. Each instant and phase
            of a single run counts as 10 of χ².
        closed: share of the gap that it closes there.
        parameters: its fitted parameters by name (``effect.parameter`` where it has several effects).
    """

    effect: str
    probability: float
    excess_after: float
    closed: float
    parameters: Mapping[str, Quantity] = field(default_factory=dict)


@dataclass(frozen=True)
class CauseSize:
    """Effect of a cause on three cycles of a swing, by the fitted model with it and without it.

    Args:
        run: id of the run whose conditions are taken.
        amplitude: of the release, rad.
        damping_ratio: with the cause, dimensionless.
        damping_ratio_without: with every cause but this one, dimensionless.
        frequency_change: of the natural frequency by the cause, a fraction.
        zero_change: of the middle of the swing by the cause, in the unit of the readings.
        reading_change: root mean square of the change of the reading, in its unit.
        stands: angle from rest within which the cause stops the body for good, rad; 0 where it does not.
    """

    effect: str
    run: str
    amplitude: float
    damping_ratio: float
    damping_ratio_without: float
    frequency_change: float
    zero_change: float
    reading_change: float
    stands: float = 0.0

    def to_json_dict(self) -> dict[str, Any]:
        """The fields, with the units of angles in their names."""
        found = dict(vars(self))
        return found | {"amplitude_rad": found.pop("amplitude"), "stands_rad": found.pop("stands")}

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """The fields, without units in their names."""
        return {**data, "amplitude": data["amplitude_rad"], "stands": data["stands_rad"]}


@dataclass(frozen=True)
class Hidden:
    """An effect that is not named, at the largest size that the runs do not exclude.

    Args:
        effect: its name.
        parameter: name of its severity.
        size: that parameter, of the sign that allows more, with its unit.
        moves: by coefficient, the size of its change by the effect, with its unit.
        significance: standard deviations by which its likeliest size differs from zero, a ratio.
    """

    effect: str
    parameter: str
    size: Quantity
    moves: Mapping[str, Quantity]
    significance: float = 0.0


@dataclass(frozen=True)
class Coefficients:
    """Coefficients of the nominal model before and after the causes are added.

    Args:
        before: by name: ``cn_beta`` and ``cn_r``; these times the rig's unstated sizes (``cn_beta_area_length``,
            ``cn_r_area_length2``); ``omega_n`` and ``zeta`` in normalised form; or ``yaw_inertia``,
            ``mechanical_damping`` and ``moment_offset`` of a body without a spring.
        after: by the same names, with the causes.
        in_phase: with a named lag, ``cn_beta`` and ``cn_r`` in phase with angle and rate, which the runs determine
            better than the coefficients of the law beside the lag; else empty.
        covariance: of ``cn_beta`` and ``cn_r`` in ``after``, and of both in ``in_phase``, 1/rad², shape (4, 4);
            empty without a named lag.
        note: on their meaning, where a cause changes it (a lag changes the meaning of Cnr).
        correlation: of those after, in their order, by the noise of the readings, the small causes and the rivals;
            the other parts of their variances count as independent. Shape (n, n); empty where it is not known.
    """

    before: Mapping[str, Quantity]
    after: Mapping[str, Quantity]
    in_phase: Mapping[str, Quantity] = field(default_factory=dict)
    covariance: tuple[tuple[float, ...], ...] = ()
    note: str = ""
    correlation: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True)
class Diagnosis:
    """The whole answer.

    Its text fields are empty until `in_words` writes them: ``verdict``, ``cautions`` and ``note``, ``reason``,
    ``words`` and ``notes`` of its parts.

    Args:
        causes: effect names, sorted; empty: no gap; ``unknown``: a gap that no effect of the vocabulary explains.
        candidates: the answers considered, the answer first, ``none`` and ``unknown`` among them.
        ambiguous_with: effects that these runs cannot distinguish from the causes.
        next_run: the run expected to distinguish them; None where not needed.
        confirmation: whether the fits' integrator agrees with the MuJoCo model, from which the gap is computed.
        hidden: the effects that could hide, ordered by their move of a coefficient against its standard deviation.
        trade_off: the two parameters of the answer that the runs separate least; None where they separate all.
        blind_spots: what these runs cannot show, in sentences.
        seconds: wall time by step, s.
        maps: data of the figures, in JSON's types.
        disturbed: disturbed runs; the answer excludes them from the disturbance on.
        remarks: of the examination before the diagnosis, on runs left out, cut or to look at.
        inclusion: by effect of the vocabulary, the probability that it is among the causes.
        rest: the remaining gap.
        repeatability: of the runs; None for a single run, or a body without a spring.
        model: the given model, with the causes written into it; None where none was given.
        closable: the explainable share of the rest, and its law; None where the rest is within chance.
        sizes: effect of each fitted cause on a swing.
        found: facts for the words, beside the numbers.
        data: the runs, which are not part of the JSON; None for an answer that was not made by `diagnose`.
    """

    campaign: str
    causes: tuple[str, ...]
    gap: GapSummary
    where: Where
    candidates: tuple[Candidate, ...]
    ambiguous_with: tuple[str, ...]
    next_run: Mapping[str, Any] | None
    coefficients: Coefficients
    confirmation: Confirmation
    noise: NoiseSummary
    decision: Decision
    verdict: str = ""
    hidden: tuple[Hidden, ...] = ()
    trade_off: TradeOff | None = None
    blind_spots: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    cautions: tuple[str, ...] = ()
    maps: Mapping[str, Any] | None = None
    provenance: Mapping[str, Any] = field(default_factory=dict)
    disturbed: tuple[Disturbance, ...] = ()
    remarks: tuple[Remark, ...] = ()
    inclusion: Mapping[str, float] = field(default_factory=dict)
    waterfall: Waterfall = field(default_factory=Waterfall)
    rest: Remainder | None = None
    repeatability: RunRepeatability | None = None
    model: PatchedModel | None = None
    closable: Closable | None = None
    sizes: tuple[CauseSize, ...] = ()
    found: Found = field(default_factory=Found)
    data: Annotated[Campaign | None, UNWRITTEN] = field(default=None, compare=False)

    def in_words(self) -> Diagnosis:
        """The answer with its text fields, and the remarks on the noise after those of the examination."""
        said = sentences(self.to_json_dict())
        return replace(
            self,
            verdict=said.verdict,
            where=replace(self.where, words=said.where),
            rest=self.rest and replace(self.rest, words=said.rest),
            closable=self.closable and replace(self.closable, words=said.closable),
            coefficients=replace(self.coefficients, note=said.note),
            noise=replace(self.noise, reason=said.noise),
            cautions=said.cautions,
            remarks=(*self.remarks, *(remark for remark in said.remarks if remark not in self.remarks)),
            model=self.model and replace(self.model, notes=said.patch),
        )

    def to_json_dict(self) -> dict[str, Any]:
        """The answer in JSON's types, by the published schema."""
        return {
            "schema_version": SCHEMA_VERSION,
            "campaign": self.campaign,
            "causes": list(self.causes),
            **self.decision.to_json_dict(),
            "verdict": self.verdict,
            "gap": as_json(self.gap),
            "where": as_json(self.where),
            "candidates": as_json(self.candidates),
            "inclusion": dict(self.inclusion),
            **self.waterfall.to_json_dict(),
            **{name: as_json(getattr(self, name)) for name in _LAST},
        }

    @classmethod
    def from_json_dict(cls, data: Mapping[str, Any]) -> Diagnosis:
        """The inverse of `to_json_dict`.

        Args:
            data: the document; further keys are ignored.

        Raises:
            TunnelError: when it is not a diagnosis: a key is missing, or a value has the wrong type.
        """
        where, remedy = "the diagnosis as JSON", "write it again with tunnel diagnose --json"
        check_shape(data, where, remedy)
        with as_described("is not a diagnosis", where, remedy):
            return _adapter().validate_json(
                json.dumps({**data, "waterfall": data, "decision": data}), strict=True
            )

    def __str__(self) -> str:
        """The verdict, short tables of the answers, gaps and coefficients, the caveats and the next steps."""
        return as_text(printed(self.to_json_dict()))

    def __repr__(self) -> str:
        """The answer, the gap, and the next step, in three lines."""
        return diagnosis_brief(self.to_json_dict())

    def _repr_html_(self) -> str:
        """The same as `__str__` for notebooks."""
        return as_notebook(printed(self.to_json_dict()))

    def plot(self, what: str = "fit", runs: Sequence[str] = ()) -> Figure:
        """Draw one figure of the report.

        Args:
            what: ``fit`` (the fit over the data) or the name of another figure, such as ``waterfall``, ``place``
                or ``repeatability``.
            runs: ids of runs for ``fit``, of which two are drawn; empty: those with the largest gap.

        Returns:
            A matplotlib figure, made without pyplot.

        Raises:
            TunnelError: for a figure or a run that this diagnosis does not have.
        """
        from tunnel_lab.report import draw  # the one upward import (decision 0001); matplotlib is slow

        return draw(self.to_json_dict(), what, runs)

    def write_report(self, path: Path | str, *, author: str = "", notes: str = "") -> Path:
        """Write the report, one HTML page, which replaces an older one.

        Args:
            author: who made the diagnosis.
            notes: for the head of the page.

        Raises:
            TunnelError: when the page cannot be written, or the answer does not include its runs.
        """
        from tunnel_lab.report import Byline, write_report  # as in `plot`

        if self.data is None:
            raise TunnelError("the answer does not hold its runs", remedy="diagnose the campaign again")
        today = datetime.now().astimezone().date().isoformat()
        return write_report(self.to_json_dict(), self.data, Path(path), Byline(today, author, notes))

    def to_frame(self) -> pl.DataFrame:
        """The answer in one table: a row for each size of the gap, parameter and coefficient.

        Returns:
            ``part`` (``gap``, a cause, ``before`` or ``after``), ``quantity``, ``value``, ``std``, ``unit``.
        """
        gap = self.gap
        rows: list[tuple[str, str, float, float | None, str]] = []
        for name in ("excess_before", "excess_after", "closed"):
            rows.append(("gap", name, getattr(gap, name), None, "1"))
        if gap.misfit is not None:
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

        Those at a bound, and those that the runs do not determine, are left out.

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
        """A row for each answer weighed: effect, probability, excess_after and closed, as in `Candidate`."""
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


@cache
def _adapter() -> TypeAdapter[Diagnosis]:
    return TypeAdapter(Diagnosis)
