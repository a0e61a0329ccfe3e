"""Facts beside the numbers of an answer, as kinds with figures and without sentences.

`diagnosis.words` has the sentence of each.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from diagnosis.findings.input_hold import OtherHold
from diagnosis.findings.other_motions import TwoModes
from diagnosis.model.fact import Fact, Noted
from diagnosis.search.rivals.two_springs import SpringError
from diagnosis.where.described import Nowhere, PlaceFound
from identification.status import Remark


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
