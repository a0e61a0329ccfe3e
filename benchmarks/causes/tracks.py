"""The tracks of the benchmark: the causes in their campaigns, and the number of campaigns."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from benchmarks.causes.entry import NAMES
from tunnel_reference.draw import CampaignDraw, Mixture, draw_campaign
from tunnel_reference.forms import FAMILIES
from tunnel_reference.make import plan_kinds
from tunnel_reference.scatter_draws import MIXED

REAL = "real"
_ANY = {"single": 0.4, "pair": 0.25, "three": 0.15, "none": 0.1, "outside": 0.1}
_RANDOM = ("buffeting", "vortex_shedding")


@dataclass(frozen=True)
class Track:
    """A part of the set.

    Args:
        count: number of campaigns.
        kinds: weight of each kind of campaign in `tunnel_reference.draw.KINDS`.
        certain: circumstances of every campaign, from `tunnel_reference.draw.CIRCUMSTANCES`.
        first: families that act in turn, one in every campaign; empty: all.
        about: description in a few words.
        scatter: whether the runs differ by chance.
        level: level of the scatter, from `tunnel_reference.scatter_draws.LEVELS`, or ``mixed``.
        stated: share of campaigns that state their scatter.
        normal: share of campaigns with normal scatter; the others have another distribution.
    """

    count: int
    kinds: Mapping[str, float]
    about: str
    certain: tuple[str, ...] = ()
    first: tuple[str, ...] = field(default=())
    scatter: bool = False
    level: str = MIXED
    stated: float = 0.0
    normal: float = 0.5


TRACKS: Mapping[str, Track] = {
    "none": Track(24, {"none": 1.0}, "the nominal model is true"),
    "one": Track(40, {"single": 1.0}, "one effect of the vocabulary, every one at least once"),
    "two": Track(24, {"pair": 1.0}, "two effects"),
    "three_and_four": Track(24, {"three": 0.5, "four": 0.5}, "three or four effects"),
    "outside": Track(24, {"outside": 1.0}, "an effect that belongs to no family: the answer is `unknown`"),
    "few_runs": Track(16, _ANY, "one or two springs, still air and one wind speed", ("few_runs",)),
    "random_moments": Track(
        16, {"single": 0.5, "pair": 0.3, "three": 0.2}, "turbulence or vortices, alone or beside others", (),
    _RANDOM ),
    "other_scales": Track(16, _ANY, "rigs up to 30 times as fast or slow, moments to 100 times", ("scaled",)),
    "coloured_and_uneven": Track(
        16, _ANY, "coloured noise; rounded or jittered time stamps", ("coloured", "uneven_stamps")
    ),
}  # fmt: skip
"""The simulated tracks of version 1; the packaged measured records are a further track, ``real``."""

_SCATTERING: Mapping[str, Track] = {
    "scatter_alone": Track(
        16, {"none": 1.0}, "runs that differ by chance, and nothing else", scatter=True, level="usual", normal=1.0
    ),
    "scatter_stated": Track(
        16, {"none": 1.0}, "the same, and the campaign states by how much", scatter=True, stated=1.0, normal=1.0
    ),
    "beside_scatter": Track(
        24, {"single": 0.6, "pair": 0.4}, "one or two effects in runs that differ by chance", scatter=True,
        stated=0.25,
    ),
    "runs_that_repeat": Track(8, {"none": 0.5, "single": 0.5}, "for comparison: none or one, and runs that repeat"),
}  # fmt: skip


@dataclass(frozen=True)
class Edition:
    """A separate set, with its own seal.

    Args:
        seed: seed of all random numbers.
        tracks: tracks by name.
        real: whether the set includes the packaged measured records.
        catalogue: edition of the reference simulator's forms when the set was drawn.
    """

    seed: int
    tracks: Mapping[str, Track]
    real: bool
    catalogue: int

    @property
    def counts(self) -> dict[str, int]:
        """Number of campaigns by track."""
        return {name: track.count for name, track in self.tracks.items()}


VERSION = 1
EDITIONS: Mapping[int, Edition] = {
    VERSION: Edition(20271001, TRACKS, True, 1),
    2: Edition(20281001, _SCATTERING, False, 2),
}
"""The sets: version 1, and beside it version 2, of runs that do not repeat exactly."""

SEED = EDITIONS[VERSION].seed
_ALL = {name: track for edition in EDITIONS.values() for name, track in edition.tracks.items()}


@dataclass(frozen=True, eq=False)
class TrackDraw:
    """One campaign to simulate.

    Args:
        name: name in the set; it does not reveal the track.
        track: track of an edition.
        draw: the campaign before its effects are scaled.
    """

    name: str
    track: str
    draw: CampaignDraw


def draw_all(seed: int, counts: Mapping[str, int]) -> list[TrackDraw]:
    """Draw the simulated campaigns.

    Args:
        seed: seed of all random numbers; equal arguments give equal campaigns.
        counts: number of campaigns by track, all of one version.

    Returns:
        The campaigns by name, tracks mixed.
    """
    of = next(edition for edition in EDITIONS.values() if set(counts) <= set(edition.tracks))
    drawn = [
        (track, draw) for track, count in counts.items() for draw in _track(seed, track, count, of.catalogue)
    ]
    order = np.random.default_rng([seed, len(of.tracks)]).permutation(len(drawn))
    return [TrackDraw(f"c{i + 1:04d}", *drawn[k]) for i, k in enumerate(order)]


def _track(seed: int, name: str, count: int, catalogue: int) -> list[CampaignDraw]:
    """The campaigns of a track; families alternate, so their frequencies differ by at most one."""
    track, number = _ALL[name], list(_ALL).index(name)
    rng = np.random.default_rng([seed, number])
    pool = np.array(track.first or [name for name in FAMILIES if name in NAMES])
    turns = [str(f) for _ in range(-(-count // len(pool))) for f in rng.permutation(pool)]
    mixture = Mixture(
        variety=0.0,
        certain=track.certain,
        scatter=float(track.scatter),
        level=track.level,
        stated=track.stated,
        normal=track.normal,
        edition=catalogue,
    )
    draws = []
    for index, kind in enumerate(plan_kinds(count, dict(track.kinds))):
        families = () if kind in ("none", "outside") else (turns[index],)
        own = np.random.default_rng([seed, number, index])
        draws.append(draw_campaign(own, kind=kind, mixture=mixture, families=families))
    return draws
