"""What the residuals say of channel and condition where no known effect names them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from diagnosis.fitting.least_squares import Fit, FitError, fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.starting_points import nominal_start
from diagnosis.localisation.backbone import Backbone, drift
from diagnosis.localisation.excess import FALSE_ALARM_RATE, band_excesses, run_excesses, shortest_interval
from diagnosis.localisation.mapping import Survey
from tunnel_sim.vocabulary.campaign import Campaign

_MOST = 0.6  # share of the excess that makes a band or a run the place of the gap
_COMPANION = 0.05  # likewise, of a second harmonic that goes with a shifted centre
_LONE = 0.85  # likewise, of one run among three or more
_BETWEEN = 0.2  # of the excess at most is left by fits to single runs where the gap lies between runs
_BLOW = 0.1  # of the record: half the missing moment within so little time is a blow
_CLEAR = 5.0  # standard deviations of the missing moment's energy
_RATIO = 1.5  # of the two drifts, for one of them to be said to lead
_MECHANICAL = 30.0  # Hz: the rig's inertia holds moments faster than this below any noise


@dataclass(frozen=True)
class Finding:
    """An answer with its reason.

    Args:
        value: the answer; None where the runs do not say.
        reason: a clause.
    """

    value: str | None
    reason: str


def infer_condition(campaign: Campaign, nominal: Fit, found: Survey) -> Finding:
    """Whether the gap needs wind.

    Args:
        campaign: the records.
        nominal: fit of the nominal model to all runs.
        found: the maps.

    Returns:
        ``wind_on`` where the wind-off runs, fitted by themselves, show no gap.
    """
    runs = nominal.problem.data.runs
    off = tuple(run.id for run in runs if not run.wind_on)
    if len(off) == len(runs):
        return Finding("always", "it shows with the wind off")
    if not off:
        return Finding(None, "with the wind on in every run, they cannot say whether it needs wind")
    if min(run.p_value for run in found.maps.runs) * len(runs) > FALSE_ALARM_RATE:
        return Finding(None, "no run shows it by itself")
    lone = _lone_run(found)
    if lone is not None and lone not in off:
        return Finding(None, f"one run alone ({lone}) cannot say whether it needs wind")
    data = replace(nominal.problem.data.subset(off), windy=False)  # without coefficients these runs lack
    try:
        alone = fit(Problem(data), nominal_start(data))
    except FitError:
        return Finding(None, "the wind-off runs could not be fitted by themselves")
    excesses = run_excesses(campaign, alone)
    tests = [run.p_value() for run in excesses]
    tests += [band.p_value for band in band_excesses(excesses)]
    count = "the wind-off run" if len(off) == 1 else f"the {len(off)} wind-off runs"
    if min(tests) * len(tests) < FALSE_ALARM_RATE:
        return Finding("always", f"{count}, fitted alone, show{'s' * (len(off) == 1)} it too")
    return Finding("wind_on", f"{count}, fitted alone, leave{'s' * (len(off) == 1)} nothing beyond noise")


def _lone_run(found: Survey) -> str | None:
    runs = found.maps.runs
    top = max(runs, key=lambda run: run.share)
    return top.id if len(runs) >= 3 and top.share > _LONE else None


def blow_interval(found: Survey, share: float = 0.5) -> tuple[float, float] | None:
    """When most of the missing moment acts, where that is a small part of the record.

    Args:
        found: the maps.
        share: of the moment's energy, a fraction.

    Returns:
        Since the start of the record, s; None where the moment is spread out, at the release, or in the noise.
    """
    edges = found.maps.time.edges
    interval = shortest_interval(edges, found.moment_energy, share)
    if interval is None or found.moment_z < _CLEAR:
        return None
    length = float(edges[-1])
    brief = interval[1] - interval[0] <= _BLOW * length
    return interval if brief and interval[0] > 0.05 * length else None


def infer_channel(nominal: Fit, found: Survey, condition: str | None) -> Finding:
    """On what the gap acts, by the residual's own marks.

    Args:
        nominal: fit of the nominal model.
        found: the maps.
        condition: as inferred.

    Returns:
        The channel; None where no mark leads.
    """
    blow = blow_interval(found)
    if blow is not None:
        return Finding("forcing", f"the moment that is missing acts within {blow[0]:.1f} to {blow[1]:.1f} s")
    return _by_band(found, condition) or _between_runs(nominal, found) or _by_drift(found)


def _by_band(found: Survey, condition: str | None) -> Finding | None:
    excess = {band.band: max(band.excess, 0.0) for band in found.maps.bands}
    whole = max(sum(excess.values()), 1e-300)
    lines = [line for line in found.maps.lines if line.share > 0.5 * _MOST]
    if lines and len(lines) >= max(1, len(found.maps.runs) // 3):
        frequency = float(np.median([line.frequency for line in lines]))
        channel = "forcing" if frequency < _MECHANICAL else "sensor"
        return Finding(channel, f"it is a spectral line near {frequency:.3g} Hz")
    if excess.get("above", 0.0) > _MOST * whole:
        return Finding("sensor", "most of it is faster than the rig can move")
    if excess.get("0", 0.0) > _MOST * whole:
        if excess.get("2f0", 0.0) > _COMPANION * whole:
            return Finding("stiffness", "the centre shifts together with the second harmonic of the motion")
        if condition == "wind_on":
            return Finding("forcing", "most of it is a slow shift of the centre that needs wind")
        return Finding("sensor", "most of it is a slow shift of the centre")
    if sum(excess.get(band, 0.0) for band in ("2f0", "3f0", "above")) > _MOST * whole:
        return Finding("sensor", "it has the motion's harmonics without its frequency or damping shifting")
    return None


def _between_runs(nominal: Fit, found: Survey) -> Finding | None:
    """Where every run by itself is linear but the runs do not agree on the coefficients."""
    curves = found.maps.backbones
    sizes = [run.reading.size for run in nominal.problem.data.runs]
    alone = [curve.alone_excess for curve in curves]
    if len(curves) < 2 or any(value is None for value in alone):
        return None
    left = sum(max(v or 0.0, 0.0) * n for v, n in zip(alone, sizes, strict=True))
    whole = sum(max(run.excess, 0.0) * n for run, n in zip(found.excesses, sizes, strict=True))
    if left > _BETWEEN * whole:
        return None
    shifts = np.array([_shift(curve) for curve in curves])
    frequency, damping = np.sum(shifts**2, axis=0)
    if frequency >= damping:
        return Finding("calibration", "each run alone is linear, but their frequencies do not agree")
    return Finding("damping", "each run alone is linear, but their damping does not agree")


def _shift(curve: Backbone) -> tuple[float, float]:
    """Relative departure of a run's own frequency from the nominal model's, and of its damping, alike in ω."""
    assert curve.alone_frequency is not None
    assert curve.alone_zeta is not None
    return curve.alone_frequency / curve.nominal_frequency - 1.0, curve.alone_zeta - curve.nominal_zeta


def _by_drift(found: Survey) -> Finding:
    frequency, damping = drift(list(found.maps.backbones))
    if frequency > _RATIO * max(damping, 0.0) and frequency > 0.0:
        return Finding("stiffness", "the frequency shifts along the decay more than the damping does")
    if damping > _RATIO * max(frequency, 0.0) and damping > 0.0:
        return Finding("damping", "the damping shifts along the decay more than the frequency does")
    return Finding(None, "the frequency and the damping shift by similar amounts along the decay")
