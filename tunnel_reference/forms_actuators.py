"""Forms of an actuator's changes to the demanded moment: a lag, a greatest moment, a greatest rate."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from tunnel_reference.catalogue import Extra, Form, Group, calibration
from tunnel_reference.true_conditions import Actuation, TrueConditions


def _with(c: TrueConditions, **changed: Any) -> TrueConditions:
    """The conditions with an actuator, added to earlier changes of it."""
    assert c.drive is not None
    return replace(c, drive=replace(c.drive, actuator=replace(c.drive.actuator or Actuation(), **changed)))


def _lag(p: float, _e: Extra, c: TrueConditions) -> TrueConditions:
    return _with(c, lags=(p,))


def _two_lags(p: float, _e: Extra, c: TrueConditions) -> TrueConditions:
    """Two equal lags in a row: at low frequencies the same delay as one of p."""
    return _with(c, lags=(0.5 * p, 0.5 * p))


def _limit(p: float, _e: Extra, c: TrueConditions) -> TrueConditions:
    """M = (1 − p) times the greatest demanded moment."""
    assert c.drive is not None
    return _with(c, limit=(1.0 - p) * c.drive.greatest)


def _soft_limit(p: float, _e: Extra, c: TrueConditions) -> TrueConditions:
    """The demanded moment m becomes M tanh(m/M), where M is the greatest demand over p."""
    assert c.drive is not None
    return _with(c, limit=c.drive.greatest / p, soft=True)


def _rate(p: float, _e: Extra, c: TrueConditions) -> TrueConditions:
    """R is the root mean square of the demanded moment over p."""
    assert c.drive is not None
    moment = c.drive.gain * c.drive.values[:, c.drive.driven]
    return _with(c, rate=float(np.sqrt(np.mean(moment**2))) / p)


FORMS = (
    Form("actuator_lag", "first_order", Group.TEXTBOOK, "τ, s", 5e-3, calibration(_lag), limits=(1e-4, 0.5),
         driven=True, edition=3),
    Form("actuator_lag", "two_lags", Group.COMMON, "τ, s", 5e-3, calibration(_two_lags), limits=(1e-4, 0.5),
         driven=True, edition=3),
    Form("actuator_saturation", "hard", Group.TEXTBOOK, "1 − M/greatest moment", 0.3, calibration(_limit),
         limits=(1e-3, 0.9), driven=True, edition=3),
    Form("actuator_saturation", "soft", Group.COMMON, "greatest moment/M", 0.3, calibration(_soft_limit),
         limits=(1e-2, 10.0), driven=True, edition=3),
    Form("actuator_rate_limit", "hard", Group.TEXTBOOK, "root mean square of the moment/R, s", 0.05,
         calibration(_rate), limits=(1e-4, 5.0), driven=True, edition=3),
)  # fmt: skip

ACTUATORS = frozenset(form.family for form in FORMS)
"""Families that change the moment on the body, not the motion of a spring's root."""
