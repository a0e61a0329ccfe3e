"""Training samples: features of simulated campaigns and of their runs with the truth, in shards on disk.

A shard is simulated together and depends on the seed, its part and its number only, so its bits do not depend on
the number of processes. What is on disk already is not made again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save

from identification.campaign.derivatives import build_design
from identification.neural.posterior.demodulated import Demodulated, demodulate
from identification.neural.posterior.features import Features, campaign_features, record_features
from tunnel_lab.training.draw import draw_for_training
from tunnel_lab.training.motions import motions_of
from tunnel_reference.conditions import Conditions
from tunnel_reference.draw import CampaignDraw
from tunnel_reference.forms import FAMILIES
from tunnel_reference.linear_families import LINEAR_IN_A_RECORD
from tunnel_reference.make import as_campaign
from tunnel_reference.readings import ReadingTerm, read_motion
from tunnel_reference.severity import Simulated, bind_effects
from tunnel_reference.terms import Motion
from tunnel_sim.files.writing import write_whole
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run
from tunnel_sim.vocabulary.record import Array, Record

PARTS = ("training", "tuning", "calibration")
CAMPAIGNS = 200
"""Campaigns of a shard that are integrated together."""
VARIANTS = 3
"""Readings of each campaign: of other noise levels, lengths and numbers of runs."""
MOST_RUNS = 16
_SUBSTEPS = 2
_NOISE = (0.3, 8.0)  # noise over the drawn one, in the variants after the first


@dataclass(frozen=True)
class ShardSpec:
    """What a shard depends on.

    Args:
        part: one of `PARTS`.
    """

    seed: int
    part: str
    number: int
    sizes: tuple[tuple[str, float], ...]

    @property
    def name(self) -> str:
        """Name of its file."""
        return f"{self.part}-{self.number:04d}.safetensors"


def write_shard(spec: ShardSpec, folder: Path) -> Path:
    """Make a shard unless it is there.

    Returns:
        Its file.
    """
    path = folder / spec.name
    if not path.exists():
        write_whole(path, save(_as_arrays(list(samples_of(spec)))))
    return path


def read_shards(folder: Path, part: str, count: int) -> dict[str, Array]:
    """The samples of the first shards of a part, joined."""
    shards = [load_file(folder / f"{part}-{number:04d}.safetensors") for number in range(count)]
    return {name: np.concatenate([shard[name] for shard in shards]) for name in shards[0]}


def samples_of(spec: ShardSpec) -> Iterator[dict[str, Array]]:
    """Draw, simulate and reduce the campaigns of a shard.

    Yields:
        A sample for each campaign (``c.`` before the names) or each of its records (``r.``).
    """
    for campaign, conditions, families, number in readings_of(spec):
        yield from reduced(campaign, truth_of(conditions), families, first_run=number)


def readings_of(spec: ShardSpec) -> Iterator[tuple[Campaign, Conditions, list[str], int]]:
    """Draw and simulate the campaigns of a shard.

    Yields:
        Each reading of a campaign with its true conditions, the families of its effects and its number among the
        readings of that campaign.
    """
    root = np.random.SeedSequence([spec.seed, PARTS.index(spec.part), spec.number])
    rngs = [np.random.default_rng(child) for child in root.spawn(CAMPAIGNS)]
    sizes = dict(spec.sizes)
    draws = [draw_for_training(rng, sizes) for rng in rngs]
    for draw, motion, rng in zip(draws, motions_of(draws, _SUBSTEPS), rngs, strict=True):
        if not np.all(np.isfinite(motion.angle)) or np.abs(motion.angle).max() > 1.0:
            continue
        for number in range(VARIANTS):
            campaign, conditions = _variant(draw, motion, rng, first=number == 0)
            yield campaign, conditions, [e.form.family for e in draw.effects], number


def _variant(
    draw: CampaignDraw, motion: Motion, rng: np.random.Generator, *, first: bool
) -> tuple[Campaign, Conditions]:
    """A campaign as read with another level of noise; the later variants may lose their end and some runs."""
    if not first:
        factor = float(np.exp(rng.uniform(*np.log(_NOISE))))
        c = draw.conditions
        draw = replace(
            draw,
            conditions=replace(c, noise_std=c.noise_std * factor, resolution=c.resolution * min(factor, 2.0)),
            seed=int(rng.integers(2**62)),
        )
    c, terms = bind_effects(draw)
    sensor = [term for term in terms if isinstance(term, ReadingTerm)]
    readings = read_motion(c, motion, sensor, np.random.default_rng(draw.seed))[: draw.conditions.samples]
    campaign = as_campaign(Simulated(draw, readings, 0.0, np.zeros(c.runs), np.zeros((0, 0))), "sample")
    runs = campaign.runs[:MOST_RUNS]
    if not first and rng.random() < 0.5:
        kept = int(len(runs[0].record.time_s) * rng.uniform(0.4, 1.0))
        runs = tuple(
            replace(run, record=Record(run.record.time_s[:kept], run.record.yaw_rad[:kept])) for run in runs
        )
    if not first and rng.random() < 0.5:
        number = int(rng.integers(1, len(runs) + 1))
        places = np.sort(rng.choice(len(runs), number, replace=False))
        runs = tuple(runs[place] for place in places)
    return replace(campaign, runs=runs), c


def truth_of(c: Conditions) -> dict[str, float]:
    """The campaign's true coefficients by name, SI."""
    return {
        "cn_beta": c.cn_beta,
        "cn_r": c.cn_r,
        "yaw_inertia": c.yaw_inertia,
        "mechanical_damping": c.mechanical_damping,
    }


def reduced(
    campaign: Campaign, truth: Mapping[str, float], families: list[str], *, first_run: int
) -> Iterator[dict[str, Array]]:
    """The samples of one campaign: itself, and one of its records.

    Args:
        truth: coefficients by name, SI.
        families: effects that act.
        first_run: its number is that of the record, modulo the number of runs.
    """
    labels = np.array([float(name in families) for name in FAMILIES])
    seen = [(run, demodulate(run.record)) for run in campaign.runs]
    shown = [(run, one) for run, one in seen if isinstance(one, Demodulated)]
    if not shown:
        return
    found = record_features([one for _, one in shown])
    kept = [(run, one, alone) for (run, one), alone in zip(shown, found, strict=True) if alone is not None]
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
        [run for run, _, _ in kept], [one for _, one, _ in kept], design, [fit for _, _, (_, fit) in kept]
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


def _sample(kind: str, features: Features, truth: Array, labels: Array) -> dict[str, Array]:
    runs = np.zeros((MOST_RUNS if kind == "c" else 1, features.runs.shape[1] + 1))
    count = min(len(features.runs), len(runs))
    runs[:count, :-1], runs[:count, -1] = features.runs[:count], 1.0
    widths = np.sqrt(np.maximum(np.diagonal(features.covariances, axis1=1, axis2=2), 1e-12))
    return {
        f"{kind}.rivals": features.rivals,
        f"{kind}.runs": runs,
        f"{kind}.shifts": features.shifts,
        f"{kind}.widths": np.where(features.known, np.minimum(widths, 1e9), 1.0),
        f"{kind}.valid": features.valid,
        f"{kind}.known": features.known,
        f"{kind}.target": np.where(features.known, (truth - features.values) / features.stds, 0.0),
        f"{kind}.labels": labels,
    }


def _as_arrays(samples: list[dict[str, Array]]) -> dict[str, Array]:
    names = sorted({name for sample in samples for name in sample})
    return {
        name: np.stack([sample[name] for sample in samples if name in sample]).astype(np.float32)
        for name in names
    }
