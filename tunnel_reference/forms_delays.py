"""Forms of errors in time: a delay of the input, and missing samples without a gap in the time stamps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tunnel_reference.catalogue import Bind, Bound, Extra, Form, Group, calibration
from tunnel_reference.readings import Order, Params, ReadingTerm, SensorSignal
from tunnel_reference.true_conditions import Array, TrueConditions

_BOTH = (-1, 1)
_LONGEST = 0.25  # s: longest lost time, for which the motion continues beyond the record


def missing(r: SensorSignal, p: Params) -> Array:
    """Removes a whole number of samples at every instant and closes the gap; padding at the end is cut later."""
    out = r.value.copy()
    count = np.round(p["lost"] * r.conditions.sample_rate).astype(int)
    for run in range(out.shape[1]):
        for share in np.atleast_1d(p["instants"][run]):
            first = int(np.ceil(share * p["duration"][run] * r.conditions.sample_rate))
            out[: out.shape[0] - count[run], run] = np.delete(out[:, run], slice(first, first + count[run]))[
                : out.shape[0] - count[run]
            ]
    return out


def _lost(instants: int) -> Bind:
    """Lost time, distributed over instants drawn for every run; the input is lost with the reading, or complete."""

    def bind(p: float, e: Extra, c: TrueConditions) -> tuple[TrueConditions, Bound | None]:
        shares = np.full((c.runs, instants), e.get("own", 0.0))
        if "seed" in e:
            shares = np.random.default_rng(int(e["seed"])).uniform(0.1, 0.9, (c.runs, instants))
        params = {
            "lost": np.full(c.runs, p / instants),
            "instants": shares,
            "duration": np.full(c.runs, e["duration"]),
        }
        lost = ReadingTerm(missing, Order.LINE, params, of_input=e.get("input_lost", 0.0) > 0.5)
        return replace(c, duration=e["duration"] + _LONGEST), lost

    return bind


def _drawn(g: np.random.Generator, c: TrueConditions) -> dict[str, float]:
    """A seed, the stated duration, and for driven runs whether the input is lost too."""
    seed = int(g.integers(0, 2**31))
    drawn = {"seed": float(seed), "duration": c.duration}
    return drawn if c.drive is None else {**drawn, "input_lost": float(seed % 2)}


def _later(p: float, e: Extra, c: TrueConditions) -> TrueConditions:
    """The input acts later by p, varied from run to run by up to the share ``spread``."""
    assert c.drive is not None
    own = np.random.default_rng(int(e["seed"])).uniform(-1.0, 1.0, c.runs)
    return replace(c, drive=replace(c.drive, delay=p * (1.0 + e["spread"] * own)))


FORMS = (
    Form("input_delay", "constant", Group.TEXTBOOK, "τ, s", 5e-4, calibration(_later), _BOTH,
         draw=lambda _g, _c: {"seed": 0.0, "spread": 0.0}, limits=(1e-6, 0.05), driven=True, edition=2),
    Form("input_delay", "by_run", Group.COMMON, "τ, s", 5e-4, calibration(_later), _BOTH,
         draw=lambda g, _c: {"seed": float(g.integers(0, 2**31)), "spread": 0.1}, limits=(1e-6, 0.05),
         driven=True, edition=2),
    Form("dropped_samples", "one_instant", Group.TEXTBOOK, "τ, s", 0.005, _lost(1), draw=_drawn,
         limits=(1e-3, 0.9 * _LONGEST)),
    Form("dropped_samples", "three_instants", Group.COMMON, "τ, s", 0.005, _lost(3), draw=_drawn,
         limits=(3e-3, 0.9 * _LONGEST)),
)  # fmt: skip
