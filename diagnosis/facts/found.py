"""Facts beside the numbers of an answer, as kinds with figures and without sentences.

`diagnosis.words` has the sentence of each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from diagnosis.facts.reading import from_json_fields
from identification.status import Remark
from tunnel_sim.files.writing import as_json
from tunnel_sim.vocabulary.drive import Hold


@dataclass(frozen=True)
class Fact:
    """One finding, whose sentence is in `diagnosis.words` under its kind.

    Args:
        figures: the quantities in the sentence, by name, in JSON's types; numbers have their units in their names.
    """

    kind: str
    figures: Mapping[str, Any] = field(default_factory=dict)

    def to_json_dict(self) -> dict[str, Any]:
        """The kind, and the figures by name beside it."""
        return {"kind": self.kind, **as_json(self.figures)}

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """Kind and figures."""
        return {"kind": data["kind"], "figures": {name: data[name] for name in data if name != "kind"}}


def as_stated(words: str) -> Fact:
    """A sentence from a nominal model or a rival, as a fact."""
    return Fact("stated", {"words": words})


@dataclass(frozen=True)
class Noted:
    """A fact about the noise of some runs, stated among the remarks on the records.

    Args:
        runs: ids of the runs.
    """

    runs: tuple[str, ...]
    fact: Fact

    def to_json_dict(self) -> dict[str, Any]:
        """The fact's fields and ``runs``."""
        return {**self.fact.to_json_dict(), "runs": list(self.runs)}

    @from_json_fields
    @staticmethod
    def _fields(data: Mapping[str, Any]) -> Mapping[str, Any]:
        """Runs and fact."""
        return {"runs": data["runs"], "fact": {name: data[name] for name in data if name != "runs"}}


BETWEEN_RUNS = ("frequency between runs", "damping between runs")
"""Kinds of reasons by which most of a gap is between the runs."""


@dataclass(frozen=True)
class PlaceFound:
    """The reasons for the place of a gap.

    Args:
        runs: number of the runs compared.
        share: of the gap, in the runs that show it, a fraction.
        false_alarm_rate: of a gap in any run, all runs together, a fraction.
        wind: excess by state of the wind, ``on`` and ``off``, a ratio; empty without runs of both.
        narrow: the intervals that locate the gap: ``time_s``, ``amplitude_rad``, ``frequency_hz``.
        bands: share of the gap by band beyond chance, fractions.
        channel: the reason for the channel.
        condition: the reason for the condition.
        compared: all causes of the answer, whose channels are compared with the place.
        agrees: whether any of them acts there, or its residual points there.
        alike: whether the residual of one points there, though none acts there.
        elsewhere: whether the place contradicts the causes: none of them acts there. Such an answer is not decided.
    """

    runs: int
    share: float
    false_alarm_rate: float
    wind: Mapping[str, float]
    narrow: tuple[str, ...]
    bands: Mapping[str, float]
    channel: Fact
    condition: Fact
    compared: tuple[str, ...] = ()
    agrees: bool = False
    alike: bool = False
    elsewhere: bool = False


@dataclass(frozen=True)
class Nowhere:
    """Residuals without a gap.

    Args:
        runs: number of the runs compared.
        p_value: of the run that differs most, corrected for their number, a probability.
        within_step: whether the residual is not white, but within the steps of the readings.
    """

    runs: int
    p_value: float
    within_step: bool


@dataclass(frozen=True)
class Nearly:
    """Effects that explain most of a gap but are not named.

    Args:
        closes: share of the gap in the fitted runs, a fraction.
        probability: of being the answer, a fraction.
        noisy: whether misbehaving noise may be the whole gap.
        rival: effects that explain as much; empty where there are none.
        rival_probability: of those, a fraction.
        misfit: channels with a significant misfit.
    """

    effects: tuple[str, ...]
    closes: float
    probability: float
    noisy: bool = False
    rival: tuple[str, ...] = ()
    rival_probability: float = 0.0
    misfit: tuple[str, ...] = ()


@dataclass(frozen=True)
class SpringError:
    """A spring that may not be as stiff as stated.

    Args:
        stiffness: as stated, N m/rad.
        error: relative error of the stiffness, a fraction.
        std: standard deviation of the error, a fraction.
        probability: among the springs that may be off, a fraction; None for one of several that are all off.
    """

    stiffness: float
    error: float
    std: float
    probability: float | None = None


@dataclass(frozen=True)
class Mode:
    """A decaying oscillation.

    Args:
        amplitude_rad: at the start, rad.
        frequency_hz: Hz.
        decay_per_s: rate of its decay, 1/s.
    """

    amplitude_rad: float
    frequency_hz: float
    decay_per_s: float


@dataclass(frozen=True)
class TwoModes:
    """Two modes in a run, where a rig has one.

    Args:
        run: id of the run.
        main: the mode that one free decay fits.
        second: the mode beside it.
        closes: share of the residual of one free decay that the second mode explains, a fraction.
    """

    run: str
    main: Mode
    second: Mode
    closes: float


@dataclass(frozen=True)
class OtherHold:
    """A delay of the input that another hold between its samples explains as well.

    Args:
        delay_s, half_sample_s: s.
        taken: the hold of the fits.
        stated: whether the campaign states it for all driven runs.
        better: whether the other hold explains the records better than chance would.
    """

    delay_s: float
    half_sample_s: float
    taken: Hold
    stated: bool
    better: bool


@dataclass(frozen=True)
class Found:
    """All facts of an answer that are not numbers of it.

    Args:
        place: reasons for the place of the gap; None where there is no gap, or no place.
        nowhere: the residuals of a campaign without a gap; else None.
        both_winds: whether the wind is off in some runs and on in others.
        robot: whether the body is the joint of a machine, and not a body in a tunnel.
        driven: whether every run is driven.
        nearly: effects that nearly explain an unexplained gap; None where there are none.
        immaterial: by coefficient, the relative change by the causes, where they change none materially.
        choices: springs of which one may be off, the likeliest first.
        hold: a delay of the input that another hold between samples explains as well; None: none.
        rivals: causes from outside the vocabulary that would explain a gap of unknown cause.
        second_modes: by run, where the gap is not explained.
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
    hold: OtherHold | None = None
    rivals: tuple[Fact, ...] = ()
    second_modes: tuple[TwoModes, ...] = ()
    limit_cycles: tuple[Remark, ...] = ()
    noise: Fact | None = None
    cautions: tuple[Fact, ...] = ()
    noted: tuple[Noted, ...] = ()
