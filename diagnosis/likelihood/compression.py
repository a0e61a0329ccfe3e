"""Runs in wider blocks, which keep the motion in fewer numbers.

Information on the causes is at or below a few times the frequency of the motion. A mean over a block T retains
the share (sin πfT / πfT)² of the power at a frequency f: with 24 blocks in a cycle all but 0.6 %. Faster
content is noise, unless the residuals of the nominal model show otherwise.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
from scipy.special import chdtri

from diagnosis.likelihood.least_squares import Fit, FitError, fit, scaled_residuals
from diagnosis.likelihood.residuals import resonance
from diagnosis.model.run_data import RunData
from diagnosis.settings import SelectionSettings
from tunnel_sim.vocabulary.record import Array

BLOCK_LOSS: Final = 0.01
"""Maximum share of the gap that wider blocks may average out. Judgement. Causes differ by much larger
shares."""

_MOST = 16  # maximum number of blocks joined into one
_FAST = 0.4  # cycles in a wider block, above which its mean hides most of a line


def compressed(nominal: Fit) -> Fit:
    """The nominal model fitted to its runs in wider blocks; unchanged where these would lose information.

    They would lose information where a run is driven, its samples are not evenly spaced, it reads a derivative
    of the angle, its noise is coloured, or its residuals contain a motion that is too fast for wider blocks.

    Args:
        nominal: the fit in the blocks used to test the noise.
    """
    data, chosen = nominal.problem.data, nominal.settings.selection
    counts = [
        _joined(run, resonance(nominal, index), chosen.blocks_in_cycle) for index, run in enumerate(data.runs)
    ]
    if max(counts) == 1 or not slow(nominal.residuals, counts, chosen):
        return nominal
    runs = tuple(run.merged(count) for run, count in zip(data.runs, counts, strict=True))
    try:
        return fit(dataclasses.replace(nominal.problem, data=data.with_runs(runs)), nominal.point)
    except FitError:
        return nominal


def in_shorter_blocks(found: Fit) -> Fit:
    """A fit with its residuals in the original, shorter blocks; its sensitivities are the same.

    Returns the fit itself where its runs are not in wider blocks.
    """
    data = found.problem.data
    runs = tuple(run.fine for run in data.runs)
    if all(fine is run for fine, run in zip(runs, data.runs, strict=True)):
        return found
    problem = dataclasses.replace(found.problem, data=data.with_runs(runs))
    residuals = scaled_residuals(problem, found.point)
    chi2 = np.array([float(r @ r) for r in residuals])
    return dataclasses.replace(found, problem=problem, residuals=residuals, chi2=chi2)


def _joined(run: RunData, frequency: float, blocks: int) -> int:
    """Number of blocks of a run to join: a power of 2, so that similar runs are integrated together.

    Args:
        frequency: frequency of the run's motion, Hz.
        blocks: minimum number of wider blocks in a cycle.
    """
    if not run.mergeable:
        return 1
    most = min(_MOST, 1.0 / (frequency * run.interval * blocks), run.reading.size / 2)
    return int(2 ** np.floor(np.log2(max(most, 1.0))))


def slow(residuals: list[Array], counts: list[int], chosen: SelectionSettings) -> bool:
    """Whether wider blocks keep nearly all of the residuals beyond noise, and every fast line.

    Args:
        residuals: residuals of the blocks, in noise standard deviations, by run, shape (n,).
        counts: number of blocks to join, by run.
    """
    excess, lost, freedom, lines, tried = 0.0, 0.0, 0, 0.0, 0
    for residual, count in zip(residuals, counts, strict=True):
        excess += float(residual @ residual) - residual.size
        if count == 1:
            continue
        blocks = residual[: residual.size // count * count].reshape(-1, count)
        inside = blocks - blocks.mean(axis=1, keepdims=True)
        lost, freedom = lost + float(np.sum(inside**2)), freedom + blocks.size - len(blocks)
        window = np.hanning(residual.size)  # leakage from the motion does not reach fast lines
        spectrum = np.fft.rfft(residual * window)[int(_FAST * residual.size / count) : -1]
        power = 2.0 * np.abs(spectrum) ** 2 / float(window @ window)  # χ² with two degrees of freedom
        lines, tried = max(lines, float(power.max())), tried + power.size
    rate = 0.5 * chosen.fast_rate
    most = float(chdtri(freedom, rate)) + BLOCK_LOSS * max(excess, 0.0)
    return bool(lost < most and lines < chdtri(2, rate / tried))
