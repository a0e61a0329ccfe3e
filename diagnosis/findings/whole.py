"""The findings of a diagnosis, and their JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Annotated, Any, Self, cast, get_args, get_type_hints

from pydantic import TypeAdapter

from diagnosis.answer.held_out import Waterfall
from diagnosis.findings.by_run import CausesByRun
from diagnosis.findings.candidates import Candidate, candidates_pictures
from diagnosis.findings.cause_sizes import CauseSize
from diagnosis.findings.causes import NamedCauses
from diagnosis.findings.closure import (
    Confirmation,
    GapSummary,
    NoiseSummary,
    closure_pictures,
    waterfall_pictures,
)
from diagnosis.findings.coefficients import Coefficients
from diagnosis.findings.decision import IN_COMMON, Decision
from diagnosis.findings.finding import Answered, Finding, Picture, SecondReading
from diagnosis.findings.fit_view import fit_pictures
from diagnosis.findings.friction_curve import FrictionCurve
from diagnosis.findings.hidden import Hidden
from diagnosis.findings.judgements import Nearly
from diagnosis.findings.misfit import Misfit
from diagnosis.findings.next_run import FurtherRuns, NextRun
from diagnosis.findings.other_motions import TwoModes
from diagnosis.findings.place import place_pictures, where_pictures
from diagnosis.findings.remainder import Remainder, law_pictures
from diagnosis.findings.repeatability import RunRepeatability
from diagnosis.findings.terms import without_scatter
from diagnosis.findings.what_it_costs import WhatItCosts
from diagnosis.model.fact import Fact, Noted
from diagnosis.patch.written_model import PatchedModel
from diagnosis.remainder.closable import Closable
from diagnosis.search.answer import UNKNOWN
from diagnosis.search.disturbance import Disturbance
from diagnosis.search.rivals.two_springs import SpringError
from diagnosis.settings import Settings
from diagnosis.where.described import Nowhere, PlaceFound, Where
from diagnosis.where.maps import Maps
from identification.show.quantity import Quantity
from identification.status import Remark
from identification.trade_off import TradeOff
from tunnel_sim.files.from_json import UNWRITTEN
from tunnel_sim.files.reading import as_described, check_shape
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError, one_line
from tunnel_sim.vocabulary.freedom import ANGLE, FREEDOMS, Freedom, Motion

SCHEMA_VERSION = 1
_LAST = (
    "sizes", "rest", "model", "closable", "ambiguous_with", "next_run", "further_runs", "coefficients",
    "confirmation", "noise", "hidden", "trade_off", "blind_spots", "cautions", "repeatability", "disturbed",
    "remarks", "found", "seconds", "maps", "provenance",
)  # fmt: skip


@dataclass(frozen=True)
class Found:
    """All facts of an answer that are not numeric results.

    Args:
        place: reasons for the place of the gap; None without a gap, or without a place.
        nowhere: the residuals of a campaign without a gap; else None.
        both_winds: whether the wind is off in some runs and on in others.
        robot: whether the body is the joint of a machine, and not a body in a tunnel.
        driven: whether every run is driven.
        nearly: effects that nearly explain an unexplained gap; None if there are none.
        immaterial: by coefficient, the relative change by the causes, where they change none materially.
        choices: springs of which one is off; the most likely first.
        readings: what causes may be instead, where the runs do not tell.
        rivals: causes from outside the vocabulary that would explain a gap of unknown cause.
        second_modes: second modes by run, where the gap is not explained.
        limit_cycles: the remarks on the runs where every run is in a limit cycle; else none.
        noise: reasons for the noise used.
        cautions: caveats.
        noted: facts about the noise.
    """

    place: PlaceFound | None = None
    nowhere: Nowhere | None = None
    both_winds: bool = False
    robot: bool = False
    driven: bool = False
    nearly: Nearly | None = None
    immaterial: Mapping[str, float] = field(default_factory=dict)
    choices: tuple[SpringError, ...] = ()
    readings: tuple[SecondReading, ...] = ()
    rivals: tuple[Fact, ...] = ()
    second_modes: tuple[TwoModes, ...] = ()
    limit_cycles: tuple[Remark, ...] = ()
    noise: Fact | None = None
    cautions: tuple[Fact, ...] = ()
    noted: tuple[Noted, ...] = ()


@dataclass(frozen=True)
class Findings:
    """All findings of a diagnosis, as values with units: the one type that is written, shown and read back.

    Text fields are empty until `in_words` writes them: ``verdict``, ``cautions`` and ``note``, and ``reason``,
    ``words`` and ``notes`` of the parts.

    Args:
        causes: effect names, sorted; empty: no gap; ``unknown``: a gap that no effect of the vocabulary explains.
        candidates: the answers considered, the answer first, ``none`` and ``unknown`` among them.
        ambiguous_with: effects that these runs cannot distinguish from the causes.
        next_run: the run expected to distinguish these effects; None where not needed.
        further_runs: runs that narrow the widest coefficient; None where the noise leaves none wide.
        confirmation: whether the fits' integrator agrees with the MuJoCo model, which computes the gap.
        hidden: the effects that could hide, ordered by their move of a coefficient over its standard deviation.
        trade_off: the two parameters of the answer that the runs separate least; None where they separate all.
        blind_spots: what these runs cannot show, in sentences.
        seconds: wall time by step, s.
        maps: data of the figures; None for an answer without them.
        disturbed: disturbed runs; the answer excludes them from the disturbance on.
        remarks: remarks of the examination on runs left out, cut, or to be checked.
        inclusion: by effect of the vocabulary, the probability that it is among the causes.
        rest: the remaining gap.
        repeatability: repeatability of the runs; None for a single run, or a body without a spring.
        model: the given model, with the causes written into it; None where none was given.
        closable: the explainable share of the rest, and its law; None where the rest is within chance.
        sizes: effect of each fitted cause on a swing.
        found: facts for the words, beside the numbers.
        friction: friction of the answer against the rate; in the JSON it is part of ``maps``. None without
            friction.
        data: the runs, which are not part of the JSON; None for an answer that was not made by `diagnose`.
        motion: ``displacement`` of a linear freedom, with m, N and kg in place of rad, N m and kg m² also in fields
            with ``_rad`` in their names; the JSON of an angle has neither it nor ``motion_scale``.
        motion_scale: scale of the motion in the computation: a constant in the form of an effect, such as 0.2
            rad, stands for as many metres divided by it.
    """

    campaign: str
    causes: tuple[str, ...]
    gap: GapSummary
    where: Where
    candidates: tuple[Candidate, ...]
    ambiguous_with: tuple[str, ...]
    next_run: NextRun | None
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
    maps: Maps | None = None
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
    friction: FrictionCurve | None = None
    costs: WhatItCosts | None = None
    by_run: CausesByRun | None = None
    further_runs: FurtherRuns | None = None
    data: Annotated[Campaign | None, UNWRITTEN] = field(default=None, compare=False)
    motion: Motion = "angle"
    motion_scale: float = 1.0

    @property
    def freedom(self) -> Freedom:
        """The freedom of the body, which names units and words."""
        return FREEDOMS[self.motion]

    @property
    def names(self) -> tuple[str, ...]:
        """The names given by the user to the campaign and its runs."""
        return self.campaign, *(run.id for run in self.gap.runs)

    @property
    def findings(self) -> dict[str, Finding]:
        """The findings with a section of their own, by the field."""
        return {name: one for name in finding_kinds() if (one := getattr(self, name)) is not None}

    @property
    def pictures(self) -> dict[str, Picture]:
        """The figures of the findings by name, in the order of the report."""
        drawn = (
            *fit_pictures(self.maps),
            *waterfall_pictures(self.waterfall, self.maps, self),
            *self.coefficients.pictures(),
            *place_pictures(self.maps, self),
            *where_pictures(self.where, self.maps),
            *candidates_pictures(self.candidates),
            *(self.friction.pictures() if self.friction else ()),
            *self.repeated.pictures(),
            *closure_pictures(self.gap, self.maps),
            *law_pictures(self.closable, self.misfit.unit),
            *(one for finding in self.findings.values() for one in finding.pictures(self)),
        )
        return {one.name: one.of(self.freedom, self.names) for one in drawn}

    @property
    def settings(self) -> Settings:
        """The settings with which the diagnosis was made."""
        return Settings().changed(self.provenance.get("settings", {}))

    @property
    def decided(self) -> bool:
        """Whether the answer is decided."""
        return self.decision.decided

    @property
    def likely(self) -> float:
        """Probability of the likeliest answer, a fraction."""
        return self.decision.credible[0][1]

    @property
    def misfit(self) -> Misfit:
        """The conversion from an excess to a misfit."""
        return self.gap.misfit

    @property
    def windy(self) -> bool:
        """Whether any run had wind; True for an answer without the data of its figures."""
        return self.maps is None or self.maps.windy

    @property
    def repeated(self) -> RunRepeatability:
        """Repeatability of the runs; an empty one where it is not known."""
        return self.repeatability or RunRepeatability()

    @property
    def between_runs_remain(self) -> bool:
        """Whether differences between the runs could explain what remains."""
        return self.closable is not None and self.closable.kind == "between"

    @property
    def coefficients_after(self) -> Mapping[str, Quantity]:
        """The coefficients with the causes, by name."""
        return self.coefficients.after

    @property
    def set_out(self) -> str:
        """The name of the answer that supplies the stated parameters, such as ``most probable answer``."""
        if self.decided:
            return "answer"
        most = max(one.probability for one in self.candidates)
        return (
            "most probable answer"
            if self.candidates[0].probability >= most
            else "most probable set of effects"
        )

    @property
    def surely_beside(self) -> list[str]:
        """The effects that are surely present where no cause is named, such as a hum found in the records."""
        if self.causes != UNKNOWN:
            return []
        return without_scatter(name for name, value in self.inclusion.items() if value >= IN_COMMON)

    @property
    def cycling(self) -> bool:
        """Whether every run is in a limit cycle."""
        return bool(self.found.limit_cycles)

    @property
    def rest_is_significant(self) -> bool:
        """Whether a gap remains beyond chance."""
        return self.rest is not None and self.rest.significant

    @property
    def names_effects(self) -> bool:
        """Whether the answer names effects: there is a gap, and its cause is not unknown."""
        return self.causes not in ((), UNKNOWN)

    @property
    def named_causes(self) -> NamedCauses:
        """The causes and their rivals."""
        return NamedCauses(
            self.causes, self.ambiguous_with, self.candidates, self.inclusion, self.found.choices,
            self.found.robot, self.settings.answer.rivals_from,
        )  # fmt: skip

    @property
    def rest_is_material(self) -> bool:
        """Whether the remaining gap may move a coefficient."""
        return self.rest is not None and self.rest.material

    def to_json_dict(self) -> dict[str, Any]:
        """The answer in JSON's types, by the published schema."""
        own = {name: as_json(getattr(self, name)) for name in (*_LAST, *finding_kinds())}
        if self.freedom is not ANGLE:
            own |= {"motion": self.motion, "motion_scale": self.motion_scale}
        if self.maps is not None:
            own["maps"] = {**own["maps"], "friction": as_json(self.friction)}
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
            **own,
        }

    @classmethod
    def from_json_dict(
        cls,
        data: Mapping[str, Any],
        *,
        where: str = "the diagnosis as JSON",
        remedy: str = "write it again with tunnel diagnose --json",
    ) -> Self:
        """The inverse of `to_json_dict`.

        Args:
            data: the document.
            where: source of the document, for an error.
            remedy: remedy, for an error.

        Raises:
            TunnelError: when it is of another version or not a diagnosis: a key or a setting is unknown, a key is
                missing, or a value has the wrong type.
        """
        check_shape(data, where, remedy)
        if (version := data.get("schema_version")) != SCHEMA_VERSION or isinstance(version, bool):
            stated_version = one_line(repr(version), 40) if "schema_version" in data else "not stated"
            what = f"schema_version is {stated_version}, but this program reads version {SCHEMA_VERSION}"
            raise TunnelError(what, where=where, remedy=remedy)
        with as_described("is not a diagnosis", where, remedy):
            adapter = _adapter(cast(Any, cls))
            found = cast(Self, adapter.validate_json(json.dumps(_by_field(data)), strict=True))
            unknown = next(_unknown_keys(data, found.to_json_dict()), "")
            stated = dict(found.provenance.get("settings", {}))
            if not all(isinstance(value, int | float) for value in stated.values()):
                raise TypeError("a setting is not a number")
        if unknown:
            what = f"is not a diagnosis ({one_line(unknown, 60)}: unknown key)"
            raise TunnelError(what, where=where, remedy=remedy)
        if gone := stated.keys() - Settings().values().keys():
            what = f"was made with {one_line(min(gone), 60)!r}, which is not a setting of this version"
            raise TunnelError(what, where=where, remedy=remedy)
        return found


def _unknown_keys(data: Any, known: Any) -> Iterator[str]:
    """The places of the document's keys that are lost when it is written again."""
    if isinstance(data, Mapping) and isinstance(known, Mapping):
        inner = {key: (value, known.get(key)) for key, value in data.items()}
        yield from (str(key) for key in data if key not in known)
    elif isinstance(data, list) and isinstance(known, list) and isinstance(next(iter(data), None), Mapping):
        inner = dict(enumerate(zip(data, known, strict=False)))
    else:
        return
    for key, both in inner.items():
        yield from (f"{key}.{place}" for place in _unknown_keys(*both))


def _by_field(data: Mapping[str, Any]) -> dict[str, Any]:
    """The document, with findings that stand elsewhere in it also under their fields."""
    friction = (data.get("maps") or {}).get("friction")
    beside = {name: value for name, value in data.items() if name != "maps"}  # the longest part
    return {**data, "waterfall": beside, "decision": beside, "friction": friction}


@cache
def finding_kinds() -> dict[str, type[Finding]]:
    """The types of the findings for which a diagnosis has a field, by the name of the field."""
    kinds: dict[str, type[Finding]] = {}
    for name, hint in get_type_hints(Findings).items():
        found = [kind for kind in get_args(hint) if isinstance(kind, type) and issubclass(kind, Finding)]
        kinds |= dict.fromkeys([name] * len(found), *found)
    return kinds


def findings_of(answered: Answered) -> dict[str, Any]:
    """All findings with a section of their own, by the field."""
    return {name: kind.find(answered) for name, kind in finding_kinds().items()}


@cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)
