"""Draws campaigns: circumstances and conditions as on rigs, effects and their severity."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from tunnel_reference.catalogue import Form, Group
from tunnel_reference.departures import draw_departures
from tunnel_reference.driven_inputs import draw_inputs
from tunnel_reference.forms import EDITION, FAMILIES, families, forms_of
from tunnel_reference.forms_actuators import ACTUATORS
from tunnel_reference.outside import LAW_FORMS, OUTSIDE_FORMS
from tunnel_reference.scatter_draws import MIXED, ScatterDraw, draw_scatter
from tunnel_reference.true_conditions import TrueConditions

_TIME_SCALE = 30.0  # periods from 1/30 of the standard rig's to 30 times as long
_MOMENT_SCALE = 100.0
_FASTER_AIR = 4.0  # at most 100 m/s, where the standard rig has 25 m/s
_MAINS_SCALES = (0.3, 8.0)  # in this range the mains are above the motion and below half of 1000 Hz

CIRCUMSTANCES = ("few_runs", "coloured", "uneven_stamps", "scaled")


def draw_circumstances(
    rng: np.random.Generator,
    conditions: TrueConditions,
    *,
    probability: float,
    mains: bool = False,
    certain: Collection[str] = (),
) -> TrueConditions:
    """Change each circumstance with the same probability, independently of the others.

    Args:
        rng: source of all random numbers.
        conditions: conditions of the standard rig.
        probability: probability of each change.
        mains: whether mains hum acts; the sample rate must then resolve it.
        certain: names in ``CIRCUMSTANCES`` of the changes that are always made.

    Returns:
        Conditions of a rig of another scale, with few springs and speeds, coloured noise, or uneven time stamps.
    """

    def occurs(name: str) -> bool:
        return rng.random() < (1.0 if name in certain else probability)

    found = conditions
    if occurs("few_runs"):
        found = _few_runs(rng, conditions)
        while found is conditions and "few_runs" in certain:  # a wind speed that the kept springs do not have
            found = _few_runs(rng, conditions)
    if occurs("coloured"):  # half or more of the noise variance falls off above a corner frequency
        corner = float(np.exp(rng.uniform(np.log(3.0), np.log(100.0))))
        found = replace(found, noise_corner=corner, coloured_share=float(rng.uniform(0.5, 0.95)))
    if occurs("uneven_stamps"):
        if rng.random() < 0.5:  # samples delayed by part of an interval, with their true times as stamps
            jitter = float(rng.uniform(0.05, 0.5))
            found = replace(found, clock_jitter=jitter, clock_seed=int(rng.integers(2**31)))
        else:  # even samples with rounded stamps
            found = replace(found, stamp_step=float(rng.uniform(0.05, 0.5)) / found.sample_rate)
    if not occurs("scaled"):
        return found
    time = float(np.exp(rng.uniform(-1.0, 1.0) * np.log(_TIME_SCALE)))
    if mains:
        time = float(np.clip(time, *_MAINS_SCALES))
    # A moment scales as length⁵/time², a speed as length/time; the air is at most four times as fast as drawn.
    top = min(_MOMENT_SCALE, _FASTER_AIR**5 * time**3)
    moment = float(np.exp(rng.uniform(-np.log(_MOMENT_SCALE), np.log(top))))
    return replace(found, time_scale=time, moment_scale=moment)


def _few_runs(rng: np.random.Generator, c: TrueConditions) -> TrueConditions:
    """The runs of one or two springs, in still air and at one speed."""
    springs, speeds = np.unique(c.spring_stiffness), np.unique(c.wind_speed[c.wind_on])
    number = min(int(rng.integers(1, 3)), springs.size)
    keep = np.isin(c.spring_stiffness, rng.choice(springs, number, replace=False))
    if speeds.size:
        keep &= ~c.wind_on | (c.wind_speed == rng.choice(speeds))
    if np.all(c.wind_on[keep]) or not np.any(c.wind_on[keep]):
        return c
    by_run = {name: value[keep] for name, value in vars(c).items() if np.shape(value) == keep.shape}
    return replace(c, **by_run)


NUMBERS = {"none": 0, "single": 1, "pair": 2, "three": 3, "four": 4}
"""Number of effects that matter, by kind of campaign."""
BEYOND = {"outside": OUTSIDE_FORMS, "law": LAW_FORMS}
"""Forms outside the known families, by kind of campaign."""
KINDS = (*NUMBERS, *BEYOND)
DEFAULT_SHARES = {"single": 0.3, "pair": 0.17, "three": 0.14, "four": 0.11, "none": 0.14, "outside": 0.14}
_STRONG_SHARE = 0.2
_SMALL = (0.03, 0.3)
"""Excess of a small effect: detectable in 10⁵ samples, but less than a third of the noise variance."""


@dataclass(frozen=True, eq=False)
class EffectDraw:
    """One effect of one campaign.

    Args:
        extra: secondary parameters of the effect.
        sign: sign of the severity parameter.
        target: required excess of this effect alone, after refitting the nominal model.
        value: magnitude of the severity parameter; a first guess until it is scaled.
        small: whether it is a small effect besides the relevant ones.
        own: excess of the effect without the part that the other relevant effects can imitate; None until it is
            known.
    """

    form: Form
    extra: dict[str, float]
    sign: int
    target: float
    value: float
    small: bool = False
    own: float | None = None


@dataclass(frozen=True, eq=False)
class CampaignDraw:
    """One campaign before it is simulated.

    Args:
        kind: name of the kind, in ``KINDS``.
        effects: the relevant ones, then small ones.
        seed: seed of the sensor's noise.
        scatter: differences between the runs; None if the runs repeat.
    """

    kind: str
    conditions: TrueConditions
    effects: tuple[EffectDraw, ...]
    seed: int
    mixture: Mixture = field(default_factory=lambda: Mixture())
    scatter: ScatterDraw | None = None


@dataclass(frozen=True)
class Mixture:
    """Probabilities of forms and circumstances.

    Args:
        textbook: probability of the textbook form.
        rare: probability that any other form is a rare one (0 for tuning sets).
        variety: probability of another scale, of few runs, of coloured noise and of uneven time stamps, each.
        small: probability of a small effect besides the relevant ones, and of a second one besides the first.
        certain: names of the circumstances that every campaign has (`tunnel_reference.draw.CIRCUMSTANCES`), and
            of the assumptions that every campaign breaks (`tunnel_reference.departures.DEPARTURES`).
        departures: probability of breaking each assumption.
        driven: whether all runs are driven, or some.
        scatter: probability that the runs differ from each other.
        level: level of these differences, in `tunnel_reference.scatter_draws.LEVELS`, or ``mixed``.
        stated: probability that a campaign states its differences.
        normal: probability that they are normally distributed; ``rare`` is the probability of a rare other
            form.
        edition: edition of the catalogue of forms.
    """

    textbook: float = 0.5
    rare: float = 0.5
    variety: float = 0.25
    small: float = 0.25
    certain: tuple[str, ...] = ()
    driven: bool = False
    departures: float = 0.0
    scatter: float = 0.0
    level: str = MIXED
    stated: float = 0.5
    normal: float = 0.5
    edition: int = EDITION

    @property
    def families(self) -> tuple[str, ...]:
        """The families from which effects are drawn."""
        return families(driven=self.driven, edition=self.edition)


def draw_campaign(
    rng: np.random.Generator, *, kind: str, mixture: Mixture | None = None, families: Sequence[str] = ()
) -> CampaignDraw:
    """Draw one campaign.

    Args:
        rng: source of all random numbers.
        kind: name of the kind, in ``KINDS``.
        families: families of the first relevant effects; the others are drawn.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}, not {kind!r}")
    mixture = mixture or Mixture()
    (between,) = rng.spawn(1)  # separate, so that the other draws are equal with and without scatter
    number = NUMBERS.get(kind, 0)
    known = mixture.families
    names = draw_families(rng, number, families, known)
    small: tuple[str, ...] = ()
    if names:
        added = 0 if rng.random() >= mixture.small else 1 + int(rng.random() < mixture.small)
        small = draw_families(rng, number + added, names, known)[number:]
    mains = "mains_hum" in (*names, *small)
    conditions = draw_circumstances(
        rng, draw_conditions(rng), probability=mixture.variety, mains=mains, certain=mixture.certain
    )
    conditions = draw_departures(
        rng, conditions, probability=mixture.departures, mains=mains, certain=mixture.certain
    )
    if mixture.driven:
        # The law of structural damping assumes a spring with a fixed root, and an actuator exerts a moment.
        by_root = not {"structural_damping", *ACTUATORS} & {*names, *small}
        conditions = draw_inputs(rng, replace(conditions, clock_jitter=0.0), by_root=by_root)
    effects = []
    for name in (*names, *small):
        forms, textbook = forms_of(name, mixture.edition), rng.random() < mixture.textbook
        others = _pool(forms, rng, mixture)
        form = forms[0] if textbook or not others else others[int(rng.integers(len(others)))]
        effects.append(_draw_effect(rng, form, conditions, small=name in small))
    if kind in BEYOND:
        pool = _pool(BEYOND[kind], rng, mixture)
        effects = [_draw_effect(rng, pool[int(rng.integers(len(pool)))], conditions)]
    scatter = None
    if between.random() < mixture.scatter:
        scatter = draw_scatter(
            between,
            conditions.runs,
            level=mixture.level,
            normal=mixture.normal,
            rare=mixture.rare,
            stated=mixture.stated,
        )
    return CampaignDraw(kind, conditions, tuple(effects), int(rng.integers(2**62)), mixture, scatter)


def redraw(draw: CampaignDraw) -> CampaignDraw:
    """Another campaign of the same kind with the same first family, from the seed of the replaced one."""
    mattering = [e.form.family for e in draw.effects if not e.small]
    rng = np.random.default_rng(draw.seed)
    return draw_campaign(rng, kind=draw.kind, mixture=draw.mixture, families=mattering[:1])


def draw_families(
    rng: np.random.Generator, number: int, first: Sequence[str] = (), known: Sequence[str] = FAMILIES
) -> tuple[str, ...]:
    """Different families; after the first, all are equally likely."""
    others = [name for name in known if name not in first]
    drawn = rng.choice(np.array(others), size=max(number - len(first), 0), replace=False)
    return (*first, *(str(name) for name in drawn))[:number]


def _pool(forms: Sequence[Form], rng: np.random.Generator, mixture: Mixture) -> list[Form]:
    """The common or the rare forms, as drawn from the mixture; not empty unless there are none at all."""
    group = Group.RARE if rng.random() < mixture.rare else Group.COMMON
    other = Group.COMMON
    known = [f for f in forms if mixture.driven or not f.driven]
    return [f for f in known if f.group is group] or [f for f in known if f.group is other]


def _draw_effect(
    rng: np.random.Generator, form: Form, conditions: TrueConditions, *, small: bool = False
) -> EffectDraw:
    """Draws secondary parameters, sign and target excess: 1 to 10, in a fifth of the cases 10 to 100."""
    top = (10.0, 100.0) if rng.random() < _STRONG_SHARE else (1.0, 10.0)
    top = _SMALL if small else top
    target = float(np.exp(rng.uniform(np.log(top[0]), np.log(top[1]))))
    extra = {k: float(v) for k, v in form.draw(rng, conditions).items()}
    sign = int(rng.choice(np.array(form.signs)))
    return EffectDraw(form, extra, sign, target, form.start, small)


def draw_conditions(rng: np.random.Generator) -> TrueConditions:
    """Draws springs, speeds, releases, truth and sensor: mostly the plan of twelve runs, otherwise another plan."""
    if rng.random() < 0.8:  # three springs at three speeds from 20°, two small releases, one medium release
        low = float(rng.choice([16.12, 21.02]))
        middle = float(rng.choice([21.02, 35.02] if low < 20.0 else [35.02]))
        high = float(rng.choice([44.84, 51.88, 67.98]))
        rows = [(k, v, 20.0) for k in (low, middle, high) for v in (0.0, 15.0, 25.0)]
        rows += [(low, 0.0, 8.0), (low, 25.0, 8.0), (middle, 20.0, 14.0)]
    else:  # two to four springs, two to four speeds including still air, 6 to 16 runs at two release angles
        table = [12.0, 16.12, 21.02, 28.0, 35.02, 44.84, 51.88, 60.0, 67.98, 80.0]
        springs = np.sort(rng.choice(np.array(table), size=int(rng.integers(2, 5)), replace=False))
        speeds = np.concatenate(
            [[0.0], np.sort(rng.choice([10.0, 12.5, 15.0, 20.0, 25.0], int(rng.integers(1, 4)), False))]
        )
        big = float(rng.choice([10.0, 15.0, 20.0]))
        rows = [(float(k), float(v), big) for k in springs for v in speeds]
        rows += [(float(springs[0]), float(v), big * 0.4) for v in (speeds[0], speeds[-1])]
        rows = rows[:16]
    stiffness, speed, degrees = (np.array(column) for column in zip(*rows, strict=True))
    release = np.round(np.radians(degrees), 4)
    duration = 10.0 if rng.random() < 0.85 else float(rng.choice([8.0, 12.0, 15.0, 20.0]))
    noise = float(rng.uniform(3e-4, 6e-4))
    start = release * (1.0 + 0.03 * rng.standard_normal(release.size))
    return TrueConditions(
        spring_stiffness=stiffness,
        wind_speed=speed,
        release_angle=release,
        start_angle=start,
        air_density=float(rng.uniform(1.18, 1.22)),
        duration=duration,
        yaw_inertia=float(rng.uniform(0.098, 0.110)),
        mechanical_damping=float(rng.uniform(0.007, 0.020)),
        cn_beta=float(rng.uniform(0.25, 0.57)),
        cn_r=float(-rng.uniform(0.06, 0.24)),
        noise_std=noise,
        stated_noise=round(noise, 5) if rng.random() < 0.5 else None,
        zero=float(0.004 * rng.standard_normal()),
    )


def with_defaults(conditions: TrueConditions) -> TrueConditions:
    """The conditions with calibration errors as arrays of shape (runs,)."""
    n = conditions.runs
    return replace(
        conditions,
        stiffness_scale=np.broadcast_to(conditions.stiffness_scale, (n,)).copy(),
        speed_offset=np.broadcast_to(conditions.speed_offset, (n,)).copy(),
    )
