"""Prepare a campaign for the fits: in blocks, and without the parts that no free decay explains."""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np

from diagnosis.model.choose import nominal_model
from diagnosis.model.data import Data
from diagnosis.model.nominal import NominalModel
from diagnosis.model.run_data import RunData, UnevenSamples, means_of
from diagnosis.model.run_noise import WhiteNoise
from diagnosis.model.similarity import AS_MEASURED, Similarity
from diagnosis.settings import Settings
from tunnel_sim.physics.input_moment import InputMoment
from tunnel_sim.vocabulary.campaign import Campaign, Run

LONG_REST: Final = 0.1
"""Minimum duration of a rest at the end of a run, as a share of the run, for it to be cut off. Judgement. The
angle at which friction stops a body says little about its motion."""
REST_STDS: Final = 5.0
"""Maximum deviation from the final reading for the body to count as at rest, in std of a block mean.
Convention."""

#: Interval of the block means, s: the motion stays below 10 Hz and the mains at 50 Hz.
BLOCK_INTERVAL = 4e-3
_END = 50  # the last fiftieth of a run gives the reading of its rest
_STILL = 0.02  # share of the largest swing within which a body counts as at rest


def prepare(
    campaign: Campaign,
    noise_variance: dict[str, float],
    similarity: Similarity = AS_MEASURED,
    interval: float = BLOCK_INTERVAL,
    model: NominalModel | None = None,
    settings: Settings = Settings(),
) -> Data:
    """Average a campaign's records in blocks.

    Args:
        noise_variance: noise variance of one sample, rad², by run id.
        similarity: how the campaign was made from the measured one.
        interval: interval between the blocks, s; the nearest number of samples, at least one.
        model: nominal model of the campaign; None: the model of its kind.
        settings: settings of the diagnosis.

    Returns:
        The prepared data. If a wind-on run states no air density, all runs have the density 1 kg/m³.
    """
    rig = campaign.rig
    model = model or nominal_model(campaign)
    dense = campaign.states_density
    runs = []
    for run in campaign.runs:
        record = run.record
        block = max(1, round(interval * record.sample_rate))
        count = record.yaw_rad.size // block
        samples = None if record.uniform else UnevenSamples.of(record, block)
        if samples is None:
            reading = means_of(record.yaw_rad[: count * block], block)
        else:
            since = record.time_s - record.time_s[0] + 0.5 * record.sample_interval
            reading = samples.means(np.interp(samples.time, since, record.yaw_rad))
        data = RunData(
            id=run.id,
            reading=reading,
            block=block,
            interval=block * record.sample_interval,
            noise=WhiteNoise(noise_variance[run.id] / block),
            spring_stiffness=run.spring_stiffness,
            wind_speed=run.wind_speed,
            air_density=(run.air_density or 0.0) if dense else 1.0,
            duration=record.duration + record.sample_interval,
            derivative=campaign.sensor.derivative,
            samples=samples,
        )
        runs.append(data if run.drive is None else _driven(data, run, model))
    return Data(
        runs=tuple(runs),
        frontal_area=rig.frontal_area or similarity.area,
        reference_length=rig.reference_length or similarity.time,
        width=rig.width or 0.0,
        model=model,
        similarity=similarity,
        settings=settings,
        freedom=campaign.sensor.freedom,
        repeatability={} if campaign.repeatability is None else campaign.repeatability.stated,
    )


def _driven(data: RunData, run: Run, model: NominalModel) -> RunData:
    """A driven run with its input."""
    assert run.drive is not None
    record = run.record
    begun = 0.0 if record.uniform else 0.5 * record.sample_interval  # like the raster of the blocks
    scale = run.drive.kind.scale * (1.0 if run.drive.gain is None else run.drive.gain)
    moment = InputMoment.of(run.drive, record.time_s - record.time_s[0] + begun, scale, -model.lead)
    return dataclasses.replace(data, drive=moment, multiplied_by=model.multiplied_by(run.drive))


def without_start(data: Data) -> Data:
    """The runs from their second passage through the middle on.

    If a hand lets go late, it drives the start of the record, which no free decay explains.

    Returns:
        The data with every run cut at the first passage through its mean after its first turning point; a run
        that would lose more than a quarter stays as it is.
    """
    runs = []
    for run in data.runs:
        values = run.reading - np.mean(run.reading)
        passages = np.flatnonzero(np.diff(np.signbit(values)))
        turn = int(np.argmax(np.abs(values[: passages[0] + 1]))) if passages.size else 0
        later = passages[passages > turn]
        stays = later.size == 0 or later[0] > values.size // 4
        runs.append(run if stays else run.part(int(later[0]) + 1))
    return dataclasses.replace(data, runs=tuple(runs))


def without_rest(data: Data) -> Data:
    """The runs up to their last reading that differs from their end by more than a fiftieth of their largest swing.

    The place at which dry friction stops a body depends discontinuously on its last swing, so χ² has many
    minima.
    """
    return dataclasses.replace(data, runs=tuple(run.part(last=_moves_until(run)) for run in data.runs))


def without_long_rest(data: Data) -> tuple[Data, tuple[str, ...]]:
    """The runs up to the end of their motion, if a long rest follows.

    Returns:
        The data with each such run cut after its last reading that differs from its end by more than the noise,
        and the ids of these runs.
    """
    ends = [_moves_until(run, REST_STDS * run.noise.scale) for run in data.runs]
    rests = [end < (1.0 - LONG_REST) * run.reading.size for run, end in zip(data.runs, ends, strict=True)]
    each = list(zip(data.runs, ends, rests, strict=True))
    runs = tuple(run.part(last=end) if rest else run for run, end, rest in each)
    return data.with_runs(runs), tuple(run.id for run, _, rest in each if rest)


def _moves_until(run: RunData, still: float | None = None) -> int:
    """Number of blocks up to the last that differs from the end by more than ``still``, rad; all if none does.

    Without ``still``, by more than a fiftieth of the largest swing.
    """
    at_end = np.median(run.reading[-max(1, run.reading.size // _END) :])
    away = np.abs(run.reading - at_end)
    moving = np.flatnonzero(away > (_STILL * away.max() if still is None else still))
    return int(moving[-1]) + 1 if moving.size else run.reading.size
