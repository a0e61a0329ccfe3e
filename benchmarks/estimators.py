"""Estimators side by side with other packages: RMSE over the Cramér–Rao bound and time, on the same records.

Run as ``python -m benchmarks.estimators``; see README.md beside it. All methods process each record in turn, so
other load on the machine affects all methods.
"""

from __future__ import annotations

import argparse
import itertools
import time
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from rich.console import Console

from benchmarks.peers import Method, present
from benchmarks.throughput import numbers
from identification.estimators import ALL_ESTIMATORS, make_estimator
from identification.estimators.output_error import OutputError
from identification.signal.run_fit import NO_WINDOWS
from identification.uncertainty.cramer_rao import SinusoidBound, damped_sinusoid_bound
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

AMPLITUDE, ZERO, RATE, DURATION = 0.35, 0.004, 1000.0, 20.0
DAMPING_RATIOS, FREQUENCIES, NOISE_SHARES = (0.002, 0.01, 0.05), (0.8, 2.0, 4.0), (0.001, 0.01)
SLOW = {"mujoco.sysid"}  # gets the first record of every third cell only


@dataclass
class Tally:
    """Results of one method: errors over the bound, coverage of 95 % intervals, times, failures."""

    zeta: dict[int, float] = field(default_factory=dict)
    omega: list[float] = field(default_factory=list)
    held: list[bool] = field(default_factory=list)
    seconds: list[float] = field(default_factory=list)
    cells: dict[tuple[float, ...], list[float]] = field(default_factory=dict)
    failures: int = 0


def records(count: int, seed: int) -> Iterator[tuple[tuple[float, ...], int, Campaign]]:
    """Cell (ζ, f, S/A), number within it and a campaign of one run."""
    rng = np.random.default_rng(seed)
    clock = np.arange(round(RATE * DURATION)) / RATE
    for zeta, frequency, share in itertools.product(DAMPING_RATIOS, FREQUENCIES, NOISE_SHARES):
        omega = 2.0 * np.pi * frequency / np.sqrt(1.0 - zeta**2)
        for number in range(count):
            phase = rng.uniform(0.0, 2.0 * np.pi)
            yaw = AMPLITUDE * np.exp(-zeta * omega * clock) * np.cos(2.0 * np.pi * frequency * clock + phase)
            yaw = yaw + ZERO + share * AMPLITUDE * rng.standard_normal(clock.size)
            sensor = SensorProperties(RATE, None, share * AMPLITUDE)
            run = Run("r", Record(clock, yaw), 0.0)
            yield (zeta, frequency, share, phase), number, Campaign("b", RigProperties(), sensor, (run,))


def bound_of(cell: tuple[float, ...], campaign: Campaign) -> SinusoidBound:
    """The Cramér–Rao bound of a record in its noise."""
    zeta, frequency, share, phase = cell
    return damped_sinusoid_bound(
        campaign.runs[0].record.time_s, amplitude=AMPLITUDE, phase=phase, frequency=frequency, zeta=zeta,
        noise_std=share * AMPLITUDE,
    )  # fmt: skip


def own(name: str) -> Method:
    """Our estimator as a method for one record. Output error also runs without windows, like the other packages."""
    plain = name.endswith(", no windows")
    estimator = OutputError(cycles_per_window=NO_WINDOWS) if plain else make_estimator(name)

    def method(campaign: Campaign) -> tuple[float, float, float | None]:
        run = estimator.estimate(campaign).runs[0]
        if run.omega_n is None or run.zeta is None:
            raise ValueError(run.status.value)
        return run.omega_n.value, run.zeta.value, run.zeta.std

    return method  # type: ignore[return-value]


def other(method: Method) -> Method:
    """Another package as a method for one record."""

    def adapted(campaign: Campaign) -> tuple[float, float, float | None]:
        record = campaign.runs[0].record
        omega, zeta = method(record.time_s, record.yaw_rad, RATE)
        if not (np.isfinite(omega) and np.isfinite(zeta)):
            raise ValueError("not finite")
        return omega, zeta, None

    return adapted  # type: ignore[return-value]


def measure(methods: dict[str, Method], count: int, seed: int) -> dict[str, Tally]:
    """Run all methods on all records."""
    tallies = {name: Tally() for name in methods}
    for place, (cell, number, campaign) in enumerate(records(count, seed)):
        zeta, frequency, *_ = cell
        bound = bound_of(cell, campaign)
        for name, method in methods.items():
            if name in SLOW and (number > 0 or place // count % 3):
                continue
            tally, begin = tallies[name], time.thread_time()
            try:
                omega, found, std = method(campaign)
            except (ValueError, RuntimeError, IndexError, np.linalg.LinAlgError):
                tally.failures += 1
                continue
            finally:
                tally.seconds.append(time.thread_time() - begin)
            error = (found - zeta) / bound.zeta
            tally.zeta[place] = error
            tally.omega.append((omega - 2.0 * np.pi * frequency / np.sqrt(1.0 - zeta**2)) / bound.omega_n)
            tally.cells.setdefault(cell[:3], []).append(error)
            if std is not None:
                tally.held.append(abs(found - zeta) <= 1.959964 * std)
    return tallies


def rms(values: Iterable[float]) -> float:
    """Root mean square; NaN if there are none."""
    squares = np.square(list(values))
    return float(np.sqrt(squares.mean())) if squares.size else np.nan


def beats(mine: Tally, peer: Tally) -> bool:
    """Whether ours is faster, without a larger RMSE of ζ on the peer's records or more failures."""
    shared = [mine.zeta[place] for place in peer.zeta if place in mine.zeta]
    return bool(
        len(shared) == len(peer.zeta)
        and rms(shared) <= 1.001 * rms(peer.zeta.values())
        and np.median(mine.seconds) < np.median(peer.seconds)
    )


def show(console: Console, tallies: dict[str, Tally], ours: list[str]) -> None:
    """Print the table, and the better methods."""
    table = numbers(
        "RMSE over the Cramér–Rao bound; 20 s at 1 kHz, ζ 0.002–0.05, 0.8–4 Hz, S/A 0.1–1 %",
        "method", "ζ", "ωn", "ζ, worst cell", "95 % held", "failed", "ms per record", "records",
    )  # fmt: skip
    for name, tally in tallies.items():
        held = f"{100 * np.mean(tally.held):.1f} %" if tally.held else ""
        worst = max((rms(errors) for errors in tally.cells.values()), default=np.nan)
        table.add_row(
            name, f"{rms(tally.zeta.values()):.3f}", f"{rms(tally.omega):.3f}", f"{worst:.2f}", held,
            str(tally.failures), f"{1e3 * np.median(tally.seconds):.1f}", str(len(tally.seconds)),
        )  # fmt: skip
        if ours and name == ours[-1]:
            table.add_section()
    console.print(table)
    sampling = 1.0 / np.sqrt(2.0 * max(len(tally.zeta) for tally in tallies.values()))
    console.print(f"Each RMSE is known to ± {100 * sampling:.0f} % (one standard deviation of sampling).")
    for name in (n for n in tallies if n not in ours):
        ahead = [mine for mine in ours if beats(tallies[mine], tallies[name])]
        console.print(
            f"Ahead of {name}, or level in RMSE (to 0.1 %), and quicker: {', '.join(ahead) or 'none'}"
        )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.estimators", description=__doc__.splitlines()[0]
    )
    parser.add_argument("--records", type=int, default=10, help="records in each of the 18 cells")
    parser.add_argument("--seed", type=int, default=1, help="of the noise")
    parser.add_argument("--only", nargs="*", help="names of methods, as in the table")
    options = parser.parse_args()
    found, absent = present()
    ours = [*ALL_ESTIMATORS, "output_error, no windows"]
    methods = {name: own(name) for name in ours} | {name: other(method) for name, method in found.items()}
    if options.only:
        methods = {name: method for name, method in methods.items() if name in options.only}
        ours = [name for name in ours if name in methods]
    console = Console(width=130)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the other packages
        show(console, measure(methods, options.records, options.seed), ours)
    for name, line in absent.items():
        console.print(f"Absent: {name} ({line})")


if __name__ == "__main__":
    main()
