"""Weights of fitted sets of effects (docs/decisions/0007-how-causes-are-weighed.md).

Real effects never have exactly a textbook form, and at the rig's signal-to-noise ratio every form error is
significant. Sets are therefore weighed by the misfit in every channel of the residuals, relative to a scale.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from diagnosis.likelihood.residuals import CHANNELS, ChannelMisfit
from diagnosis.settings import WeighingSettings
from tunnel_sim.vocabulary.record import Array

#: Channels into which other channels leak when sets are compared, 1 or 0, shape (6,): a phase error, squared,
#: is an amplitude error. A misfit of the zero or of the harmonics is not a phase error.
OF_MOTION = np.array([0.0 if name in ("zero", "harmonics") else 1.0 for name in CHANNELS])
#: Channels into which others leak, for the odds against ``unknown``: all channels, as in the regression.
ALL_CHANNELS = np.ones(len(CHANNELS))


@dataclass(frozen=True, eq=False)
class FittedSet:
    """Misfit of a fitted set of effects.

    Args:
        effects: names, in any order.
        share: unexplained share of the gap, a fraction; below 0 by chance.
        excess: χ² beyond noise by channel, shape (6,), dimensionless.
        numbers: number of further parameters: freed forms and instants, less two where gravity replaces a spring.
        outside: whether the set is from outside the vocabulary; its probability is then added to ``unknown``.
        scatter_cost: −2 ln of the evidence of the set's chance differences between runs, dimensionless.
        shown_between_runs: number of effects in the set that only the comparison of runs shows.
    """

    effects: tuple[str, ...]
    share: float
    excess: Array
    numbers: int = 0
    outside: bool = False
    scatter_cost: float = 0.0
    shown_between_runs: int = 0


def least_excess(excesses: Sequence[Array]) -> Array:
    """The least misfit of any set by channel, at most 0, shape (6,).

    The contribution of chance is common to all sets, because they are fitted to the same noise; only
    differences between sets count.

    Args:
        excesses: χ² beyond noise, each of shape (6,).
    """
    return np.asarray(np.min([np.zeros(6), *excesses], axis=0), np.float64)


def common_misfit(excesses: Sequence[Array]) -> float:
    """The largest χ² beyond noise of a channel that remains in every set: a model error that no set explains.

    Args:
        excesses: χ² beyond noise, each of shape (6,).
    """
    return max(0.0, float(np.max(np.min(excesses, axis=0)))) if excesses else 0.0


def misfit_scale(
    nominal: ChannelMisfit,
    chosen: WeighingSettings,
    common: float = 0.0,
    chance: float | Array | None = None,
) -> Array:
    """χ² by channel that needs no cause, shape (6,).

    It allows for chance and for a model error. The model error is a share of the amplitude of the gap in the
    same channel, since no real effect has its textbook form; or the common misfit of all sets if that is
    larger, up to a share of the motion. An error of the frequency must not hide a cause in the damping. Where
    the runs differ by chance, chance alone is also an answer, and the likelihood decides between them: the
    logarithm of the weight falls by half of a small χ².

    Args:
        nominal: misfit of the nominal model, and the motion.
        common: χ² of a channel that remains in every set (`common_misfit`), dimensionless.
        chance: χ² due to chance, by channel or common to all; None: as for a superfluous effect.
    """
    needless = chosen.needless_chi2 if nominal.repeats else 2.0 * chosen.steepness
    by_chance = needless if chance is None else chance
    return np.asarray(by_chance + error_of_form(nominal, chosen, common), np.float64)


def error_of_form(nominal: ChannelMisfit, chosen: WeighingSettings, common: float = 0.0) -> Array:
    """χ² by channel that an effect may leave because its form is not exact, shape (6,), dimensionless.

    A share of the amplitude of the gap: most of it in the channels of the gap, some of it in the others.

    Args:
        nominal: misfit of the nominal model, and the motion.
        common: χ² of a channel that remains in every set (`common_misfit`), dimensionless.
    """
    by_form = chosen.form_error**2 * _leaked(nominal.excess, ALL_CHANNELS, chosen.leak)
    return np.minimum(np.maximum(by_form, common), chosen.model_error**2 * nominal.motion)


def log_weight(
    left: Array,
    scale: Array,
    effects: int,
    numbers: int,
    chosen: WeighingSettings,
    scatter_cost: tuple[float, float] = (0.0, 0.0),
    shown_between_runs: int = 0,
) -> float:
    """Logarithm of the weight of a set among all sets.

    Args:
        left: χ² by channel beyond the best set's, shape (6,).
        scale: from `misfit_scale`, shape (6,).
        effects: number of effects.
        numbers: number of further parameters.
        scatter_cost: −2 ln of the evidence of the set's chance differences between runs, and of the nominal
            model's. A reduction that superfluous effects may cause does not count.
        shown_between_runs: number of effects that only the comparison of runs shows; they could reduce this
            cost.
    """
    own, nominal = scatter_cost
    cost = min(own + chosen.needless_scatter * shown_between_runs, max(own, nominal))
    price = chosen.set_price * effects + chosen.form_price * numbers + 0.5 * chosen.scatter_exponent * cost
    return -chosen.steepness * log_misfit(left, scale, OF_MOTION, chosen.leak) - price


def log_misfit(left: Array, scale: Array, leaking: Array, leak: float) -> float:
    """Sum over the channels of the logarithm of the misfit; 0 without a misfit.

    Args:
        left: χ² by channel, shape (6,), dimensionless.
        scale: from `misfit_scale`, shape (6,).
        leaking: 1 for the channels into which others leak, else 0, shape (6,): `OF_MOTION` or `ALL_CHANNELS`.
        leak: share of the misfit in other channels that counts in a channel.
    """
    return float(np.sum(np.log1p(_leaked(left, leaking, leak) / scale)))


def _leaked(excess: Array, leaking: Array, leak: float) -> Array:
    """χ² by channel with the share of the other channels that counts in it, shape (6,), dimensionless.

    Args:
        excess: χ² beyond noise by channel, shape (6,), dimensionless.
    """
    above = np.maximum(excess, 0.0)
    shared = leaking * above
    return np.asarray(above + leak * leaking * (shared.sum() - shared), np.float64)
