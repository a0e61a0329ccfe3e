"""Training samples: features of simulated campaigns and of their runs with the truth, as an experiment.

A shard is simulated together and depends only on the seed, its part and its number.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from identification.campaign.derivatives import build_design
from identification.estimate import PARAMETERS
from identification.neural.demodulated import Demodulated, demodulate
from identification.neural.rivals import Features, campaign_features, record_features
from tunnel_lab.experiments.experiment import Done, Experiment, parquet
from tunnel_reference.catalogue import LINEAR_IN_A_RECORD, LOST_SAMPLES, ROD, Form, Group
from tunnel_reference.draw import CampaignDraw, EffectDraw, Mixture, draw_campaign
from tunnel_reference.forms import FAMILIES, FORMS
from tunnel_reference.integrator import BoundLaw, RodMotion, integrate
from tunnel_reference.make import as_campaign
from tunnel_reference.readings import ReadingTerm, read_motion
from tunnel_reference.severity import Simulated, bind_effects, read_and_fit
from tunnel_reference.true_conditions import TrueConditions
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run
from tunnel_sim.vocabulary.record import Array, Record

TRAINING = "training"
PARTS = (TRAINING, "tuning", "calibration")
LETTERS = {"records": "r", "campaigns": "c"}
"""Kinds of samples by the name of their table."""
CAMPAIGNS = 200
"""Number of campaigns of a shard that are integrated together."""
VARIANTS = 3
"""Number of readings of each campaign, with other noise levels, lengths and numbers of runs."""
MOST_RUNS = 16
_SUBSTEPS = 2
_NOISE = (0.3, 8.0)  # factor on the drawn noise, in the variants after the first
SAMPLE_RATE = 250.0
"""Hz; the noise is reduced in proportion to the root of the rate, which preserves the information at 1000 Hz."""
DURATION = 10.0
KINDS: Mapping[str, float] = {"none": 0.25, "single": 0.4, "pair": 0.15, "three": 0.12, "four": 0.08}
_MIXTURE = Mixture(textbook=0.4, rare=0.0)
_UNIT = 3.0  # excess to which the forms are scaled
_ROUNDS = 3


@dataclass(frozen=True)
class ShardSpec:
    """The specification of a shard; its part is one of `PARTS`."""

    seed: int
    part: str
    number: int
    sizes: tuple[tuple[str, float], ...]


def samples_of(seed: int, shards: Mapping[str, int], sizes: Mapping[str, float]) -> Experiment[ShardSpec]:
    """The samples of some shards of each part, a table for each network; shards may be added later.

    Args:
        shards: number of shards of each part.
        sizes: sizes from `sizes_at_unit_excess`.
    """
    known = tuple(sorted(sizes.items()))
    return Experiment(
        TRAINING,
        [ShardSpec(seed, part, number, known) for part, count in shards.items() for number in range(count)],
        shard_samples,
        lambda spec: f"{spec.part}-{spec.number:04d}",
        {"seed": seed, "sizes": dict(sizes)},
        datasets=tuple(LETTERS),
        elsewhere="name another file, or add --restart",
    )


def shard_samples(spec: ShardSpec) -> Done:
    """The samples of a shard: a row for each, with an array in each column."""
    samples = [
        sample
        for campaign, conditions, families, number in readings_of(spec)
        for sample in reduced(campaign, truth_of(conditions), families, first_run=number)
    ]
    files = {}
    for dataset, letter in LETTERS.items():
        mine = [values for kind, values in samples if kind == letter]
        names = sorted(mine[0]) if mine else ()
        stacked = {name: np.stack([one[name] for one in mine]).astype(np.float32) for name in names}
        files[dataset] = parquet(pl.DataFrame(stacked))
    return Done(files)


def read_samples(folder: Path, dataset: str, part: str, count: int | None = None) -> dict[str, Array]:
    """The samples of the first shards of a part, joined: arrays by name, their first axis the samples.

    Args:
        dataset: ``records`` or ``campaigns``.
        count: number of shards; None: all.
    """
    paths = sorted((folder / dataset).glob(f"{part}-*.parquet"))[:count]
    frames = [frame for frame in map(pl.read_parquet, paths) if frame.width]
    return {series.name: series.to_numpy() for series in pl.concat(frames).rechunk()}


def readings_of(spec: ShardSpec) -> Iterator[tuple[Campaign, TrueConditions, list[str], int]]:
    """Draw and simulate the campaigns of a shard, and yield each reading of each campaign.

    Yields:
        A reading with its true conditions, the families of its effects and its number in the campaign.
    """
    root = np.random.SeedSequence([spec.seed, PARTS.index(spec.part), spec.number])
    rngs = [np.random.default_rng(child) for child in root.spawn(CAMPAIGNS)]
    sizes = dict(spec.sizes)
    draws = [draw_for_training(rng, sizes) for rng in rngs]
    for draw, motion, rng in zip(draws, motions_of(draws, _SUBSTEPS), rngs, strict=True):
        if not np.all(np.isfinite(motion.angle)) or np.abs(motion.angle).max() > 1.0:
            continue
        for number in range(VARIANTS):
            # variants after the first have another noise level, and may be shorter and lack some runs
            read, first = draw, number == 0
            if not first:
                factor, c = float(np.exp(rng.uniform(*np.log(_NOISE)))), draw.conditions
                coarser = c.resolution * min(factor, 2.0)
                noisier = replace(c, noise_std=c.noise_std * factor, resolution=coarser)
                read = replace(draw, conditions=noisier, seed=int(rng.integers(2**62)))
            c, terms = bind_effects(read)
            sensor = [term for term in terms if isinstance(term, ReadingTerm)]
            readings = read_motion(c, motion, sensor, np.random.default_rng(read.seed))[
                : read.conditions.samples
            ]
            campaign = as_campaign(
                Simulated(read, readings, 0.0, np.zeros(c.runs), np.zeros((0, 0))), "sample"
            )
            runs = campaign.runs[:MOST_RUNS]
            if not first and rng.random() < 0.5:
                kept = int(len(runs[0].record.time_s) * rng.uniform(0.4, 1.0))
                runs = tuple(
                    replace(run, record=Record(run.record.time_s[:kept], run.record.yaw_rad[:kept]))
                    for run in runs
                )
            if not first and rng.random() < 0.5:
                count = int(rng.integers(1, len(runs) + 1))
                places = np.sort(rng.choice(len(runs), count, replace=False))
                runs = tuple(runs[place] for place in places)
            yield replace(campaign, runs=runs), c, [e.form.family for e in draw.effects], number


def truth_of(c: TrueConditions) -> dict[str, float]:
    """The campaign's true coefficients by name, SI."""
    return {name: getattr(c, name) for name in PARAMETERS}


def reduced(
    campaign: Campaign, truth: Mapping[str, float], families: list[str], *, first_run: int
) -> Iterator[tuple[str, dict[str, Array]]]:
    """The samples of one campaign: the campaign itself, and one of its records.

    Args:
        truth: true coefficients by name, SI.
        families: families of the acting effects.
        first_run: number of the record's run, modulo the number of runs.
    """
    labels = np.array([float(name in families) for name in FAMILIES])
    seen = [(run, demodulate(run.record)) for run in campaign.runs]
    shown = [(run, motion) for run, motion in seen if isinstance(motion, Demodulated)]
    if not shown:
        return
    features = record_features([motion for _, motion in shown])
    kept = [
        (run, motion, alone)
        for (run, motion), alone in zip(shown, features, strict=True)
        if alone is not None
    ]
    if not kept:
        return
    coefficients = np.array(list(truth.values()))
    if not LINEAR_IN_A_RECORD & set(families):
        for place in {(5 * first_run) % len(kept), (5 * first_run + 2) % len(kept)}:
            run, _, (alone, _) = kept[place]
            yield _sample("r", alone, decay_of(coefficients, run, campaign.rig), labels)
    design = build_design([run for run, _, _ in kept], campaign.rig)
    if "g" not in design.columns and "d" not in design.columns:
        return
    whole = campaign_features(
        [run for run, _, _ in kept],
        [motion for _, motion, _ in kept],
        design,
        [fit for _, _, (_, fit) in kept],
    )
    if whole is not None:
        yield _sample("c", whole, coefficients, labels)


def decay_of(coefficients: Array, run: Run, rig: RigProperties) -> Array:
    """ζ and ωn of a run at small amplitude.

    Args:
        coefficients: true Cnβ, Cnr, Izz and Cr, SI, shape (4,).

    Returns:
        ζ and ωn in rad/s, shape (2,).
    """
    cn_beta, cn_r, inertia, damping = coefficients
    design = build_design([run], rig)
    load, drag = design.stiffness_loads[0], design.damping_loads[0]
    omega = np.sqrt(((run.spring_stiffness or 1.0) - load * cn_beta) / inertia)
    return np.array([(damping - drag * cn_r) / (2.0 * inertia * omega), omega])


def _sample(kind: str, features: Features, truth: Array, labels: Array) -> tuple[str, dict[str, Array]]:
    runs = np.zeros((MOST_RUNS if kind == "c" else 1, features.runs.shape[1] + 1))
    count = min(len(features.runs), len(runs))
    runs[:count, :-1], runs[:count, -1] = features.runs[:count], 1.0
    widths = np.sqrt(np.maximum(np.diagonal(features.covariances, axis1=1, axis2=2), 1e-12))
    return kind, {
        "rivals": features.rivals,
        "runs": runs,
        "shifts": features.shifts,
        "widths": np.where(features.known, np.minimum(widths, 1e9), 1.0),
        "valid": features.valid,
        "known": features.known,
        "target": np.where(features.known, (truth - features.values) / features.stds, 0.0),
        "labels": labels,
    }


def draw_for_training(rng: np.random.Generator, sizes: Mapping[str, float]) -> CampaignDraw:
    """Draw one campaign; sizes are the magnitudes of the forms' parameters at the unit excess, by `label`."""
    kind = str(rng.choice(np.array(list(KINDS)), p=list(KINDS.values())))
    draw = draw_campaign(rng, kind=kind, mixture=_MIXTURE)
    while any(e.form.family == ROD for e in draw.effects) and len(draw.effects) > 1:
        draw = draw_campaign(rng, kind=kind, mixture=_MIXTURE)
    effects = tuple(
        replace(
            effect,
            extra={k: DURATION if k == "duration" else v for k, v in effect.extra.items()},
            value=_clipped(
                effect.form,
                sizes[label(effect.form)]
                * np.sqrt(effect.target / _UNIT)
                * float(np.exp(0.4 * rng.standard_normal())),
            ),
        )
        for effect in draw.effects
    )
    conditions = at_low_rate(draw.conditions)
    if rng.random() >= 0.5:  # coefficients from wider ranges
        conditions = replace(
            conditions,
            mechanical_damping=float(np.exp(rng.uniform(np.log(0.003), np.log(0.15)))),
            cn_beta=float(rng.uniform(-0.2, 0.8)),
            cn_r=float(-rng.uniform(0.0, 0.4)),
        )
    return replace(draw, conditions=conditions, effects=effects)


def label(form: Form) -> str:
    """Family and name of a form."""
    return f"{form.family}/{form.name}"


def at_low_rate(c: TrueConditions) -> TrueConditions:
    """The campaign at the sample rate of training, with white noise of unchanged information."""
    share = SAMPLE_RATE / c.sample_rate
    white = (1.0 - c.coloured_share) * c.noise_std**2 * share
    coloured = c.coloured_share * c.noise_std**2
    return replace(
        c,
        sample_rate=SAMPLE_RATE,
        duration=DURATION,
        noise_std=float(np.sqrt(white + coloured)),
        coloured_share=coloured / (white + coloured),
        noise_corner=min(c.noise_corner, 0.3 * SAMPLE_RATE),
        resolution=c.resolution * float(np.sqrt(share)),
        air_density=round(float(np.mean(c.air_density)), 4),  # rounded as in the campaign's statement
        stamp_step=0.0,
        time_scale=1.0,
        moment_scale=1.0,
    )


def sizes_at_unit_excess(seed: int) -> dict[str, float]:
    """The magnitude of each common form that gives about the unit excess in one campaign."""
    forms = [form for form in FORMS if form.group is not Group.RARE and not form.driven]
    root = np.random.SeedSequence(seed)
    draws = []
    for form, child in zip(forms, root.spawn(len(forms)), strict=True):
        rng = np.random.default_rng(child)
        plain = draw_campaign(rng, kind="none", mixture=Mixture(variety=0.0))
        c = at_low_rate(plain.conditions)
        by_run = {name: value[:9] for name, value in vars(c).items() if np.shape(value) == (c.runs,)}
        conditions = replace(c, **by_run)
        extra = {k: float(v) for k, v in form.draw(rng, conditions).items()}
        effect = EffectDraw(form, extra, form.signs[-1], _UNIT, form.start)
        draws.append(replace(plain, conditions=conditions, effects=(effect,)))
    for _ in range(_ROUNDS):
        excesses = []
        for draw, motion in zip(draws, motions_of(draws, 1), strict=True):
            with np.errstate(over="ignore", invalid="ignore"):
                try:
                    excesses.append(read_and_fit(draw, motion).excess)
                except ValueError:  # the motion grows without bound
                    excesses.append(np.inf)
        draws = [nearer(draw, excess) for draw, excess in zip(draws, excesses, strict=True)]
    return {label(form): draw.effects[0].value for form, draw in zip(forms, draws, strict=True)}


def nearer(draw: CampaignDraw, excess: float) -> CampaignDraw:
    """A draw with one effect, scaled nearer to the unit excess.

    Args:
        excess: excess of the draw, in noise variances (a ratio); infinite where the motion grows without bound.
    """
    effect = draw.effects[0]
    if np.isfinite(excess):
        factor = float(np.sqrt(_UNIT / max(excess, 0.03)))
    else:  # too large an effect, or a lag too small for the steps
        factor = 3.0 if effect.value < effect.form.start else 0.1
    value = _clipped(effect.form, effect.value * float(np.clip(factor, 0.2, 10.0)))
    return replace(draw, effects=(replace(effect, value=value),))


def _clipped(form: Form, value: float) -> float:
    # At the low rate one sample is the shortest possible loss.
    lost = LOST_SAMPLES.get(label(form))
    least = form.limits[0] if lost is None else lost / SAMPLE_RATE
    return float(np.clip(value, least, form.limits[1]))


def motions_of(draws: Sequence[CampaignDraw], substeps: int) -> list[RodMotion]:
    """Integrate campaigns together; campaigns with a flexible rod, always a single effect, in closed form."""
    bound = [bind_effects(draw) for draw in draws]
    rigid = [place for place, (c, _) in enumerate(bound) if c.rod is None]
    terms = [[term for term in bound[place][1] if isinstance(term, BoundLaw)] for place in rigid]
    integrated: dict[int, RodMotion] = {}
    if rigid:
        integrated = dict(
            zip(rigid, integrate([bound[p][0] for p in rigid], terms, substeps=substeps), strict=True)
        )
    return [
        integrated[place] if place in integrated else flexible_motion(c) for place, (c, _) in enumerate(bound)
    ]


def flexible_motion(c: TrueConditions) -> RodMotion:
    """Motion of the upper end of a linear flexible rod, from the modes of its four states."""
    angle = np.empty((c.samples, c.runs))
    rate = np.empty_like(angle)
    time = np.arange(c.samples) / c.sample_rate
    for run in range(c.runs):
        assert c.rod is not None
        # The equations of body angle and rate, upper angle and rate, and their state at the release.
        spring, air, drag = c.true_stiffness[run], c.air_stiffness[run], c.air_damping[run]
        top, body = c.rod.share * c.yaw_inertia, (1.0 - c.rod.share) * c.yaw_inertia
        rod = 1.0 / c.rod.compliance
        damper = 2.0 * c.rod.damping_ratio * np.sqrt(rod * top)
        matrix = np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [(air - rod) / body, (drag - damper) / body, rod / body, damper / body],
                [0.0, 0.0, 0.0, 1.0],
                [rod / top, damper / top, -(spring + rod) / top, -(c.mechanical_damping + damper) / top],
            ]
        )
        release = c.start_angle[run]
        held_body = np.array([release, 0.0, release * rod / (spring + rod), 0.0])
        held_top = np.array([release * rod / (rod - air), 0.0, release, 0.0])
        start = held_body if c.rod.held_body else held_top
        values, modes = np.linalg.eig(matrix)
        weights = np.linalg.solve(modes, start.astype(complex))
        states = (modes * weights) @ np.exp(np.outer(values, time))
        angle[:, run], rate[:, run] = states[2].real, states[3].real
    return RodMotion(angle, rate)
