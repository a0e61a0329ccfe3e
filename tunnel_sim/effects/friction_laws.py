"""Dry friction and its general forms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from tunnel_sim.effects.base import Drawn
from tunnel_sim.effects.capabilities import Friction
from tunnel_sim.effects.parameters import parameter
from tunnel_sim.effects.traits import Text
from tunnel_sim.physics.run_settings import SettingsTable
from tunnel_sim.vocabulary.record import Array

# At 2 rad/s, saturating friction has risen to 96 %, and 2 % of a peak remain. A slower change would resemble
# damping.
_LOW_RATE = 1.0  # rad/s
_SHOWN = 2.0  # standard deviations at which a presliding range differs from the textbook form
_UNCHANGED_AT = 2.0  # rad/s: rate at which the power of the rate is 1, as in the compiled law
#: Forms of friction by parameters of the moment law.
CONTACT = {
    "presliding": "presliding",
    "friction_exponent": "exponent",
    "friction_saturation": "saturation",
    "friction_peak": "peak",
    "friction_peak_rate": "peak_rate",
    "friction_load": "load",
}
#: Terms of the moment law; each makes friction depend on the rate.
AGAINST_RATE = ("friction_exponent", "friction_saturation", "friction_peak")


@dataclass(frozen=True)
class CoulombFriction(Friction):
    """Dry friction, as in bearings, seals and gears.

    With a presliding range the contact deflects before it slides (Dahl 1968; Canudas de Wit et al. 1995, doi
    10.1109/9.376053): z is the deflection, zero at the release; zs is the deflection at which it slides; 2
    Tc/zs is the stiffness just after the sliding reverses.

    Sliding friction depends on the rate in three ways: it rises as a power less than one, it saturates, or it has a
    peak near rest (Armstrong-Hélouvry et al. 1994). All of them leave the friction less than proportional to the
    rate, which separates the family from damping.

    In a joint, friction grows with the moment carried (Hamon, Gautier & Garrec 2011): gravity's or an
    actuator's, whichever is greater, because they act on the two sides of the joint. The moment of a spring
    does not
    count: friction proportional to it is structural damping.
    """

    name = "coulomb_friction"
    place = 1
    channel = "damping"
    condition = "always"
    jumps = True
    size = "dry friction of {friction_moment}"
    advice = "Reduce the dry friction of the bearing and the sensor"
    advice_for_joint = (
        "Reduce the dry friction of the joint (gear, bearings and seals), or add it to the model"
    )
    equation = (
        "−Tc sgn β̇; rest while the other moments stay within ±Tc; general forms: −Tc z/zs, ż = β̇ − |β̇| z/zs; "
        "(|β̇|/2 rad/s)^n Tc, tanh(|β̇|/v0) Tc or (1 + b exp(−(β̇/vs)²)) Tc for Tc; in a joint Tc + μ |M|, where M is "
        "the greater of the moments of gravity and of an actuator"
    )
    signature = (
        "The envelope falls linearly, by 4Tc/Kr per cycle, so the damping ratio rises "
        "as the amplitude decays, and the body can come to rest off centre."
    )
    references = (
        "Feeny & Liang, J. Sound Vib. 195 (1996) 149, doi 10.1006/jsvi.1996.0411",
        "Canudas de Wit et al., IEEE Trans. Autom. Control 40 (1995) 419, doi 10.1109/9.376053",
        "Armstrong-Hélouvry, Dupont & Canudas de Wit, Automatica 30 (1994) 1083, doi 10.1016/0005-1098(94)90209-7",
        "Hamon, Gautier & Garrec, IEEE Int. Conf. Robotics and Automation (2011) 1077",
    )
    example = (0.05,)

    friction_moment: float = parameter(
        "Tc", "N m", "friction moment", scale=0.004, lower=0.0, upper=1e4, rate_exponent="exponent"
    )
    presliding: float = parameter(
        "zs",
        "rad",
        "deflection at which the contact slides",
        scale=0.005,
        lower=0.0,
        upper=0.2,
        fit_lower=5e-4,  # below this rate the contact moves faster than the integrator steps
        form=True,
    )
    exponent: float = parameter(
        "n", "1", "power of the rate in the moment (unchanged at 2 rad/s)",
        scale=0.4, lower=0.0, upper=0.9, form=True, inside=True,
    )  # fmt: skip
    saturation: float = parameter(
        "v0", "rad/s", "rate at which the friction has risen to 76 %; 0: no rise",
        scale=0.1, lower=0.0, upper=10.0, fit_lower=2e-3, fit_upper=_LOW_RATE,
        form=True, inside=True,
    )  # fmt: skip
    peak: float = parameter(
        "b", "1", "friction near rest over friction of fast sliding, minus one",
        scale=1.0, lower=0.0, upper=9.0, form=True,
    )  # fmt: skip
    peak_rate: float = parameter(
        "vs", "rad/s", "rate at which 37 % of the peak remains",
        scale=0.1, lower=1e-3, upper=10.0, fit_lower=0.01, fit_upper=_LOW_RATE, default=0.2,
        form=True, inside=True,
    )  # fmt: skip
    load: float = parameter(
        "μ", "1", "further friction per moment carried by the joint, of gravity or of an actuator",
        scale=0.1, lower=0.0, upper=0.9, form=True, of_load=True,
    )  # fmt: skip

    @classmethod
    def forms(cls) -> tuple[tuple[str, ...], ...]:
        """Presliding, each dependence on the rate, the dependence on the load, and both load and presliding."""
        by_rate = ("exponent",), ("saturation",), ("peak", "peak_rate")
        return ("presliding",), *by_rate, ("load",), ("presliding", "load")

    @property
    def is_null(self) -> bool:
        """Whether there is neither a constant friction nor one that grows with the load."""
        return self.friction_moment == 0.0 and self.load == 0.0

    @classmethod
    def phrase(cls, values: Mapping[str, float], stds: Mapping[str, float | None], text: Text) -> str:
        """The friction, the deflection of its contact, and its dependence on the rate or the load."""
        words = super().phrase(values, stds, text)
        presliding, std = values.get("presliding", 0.0), stds.get("presliding")
        if std is not None and presliding > _SHOWN * std:
            words = f"{words} whose contact deflects by {text(presliding, std, 'rad')} before it slides,"
        if (load := values.get("load", 0.0)) > 0.0:
            std = stds.get("load")
            share = text(100.0 * load, None if std is None else 100.0 * std, "%")
            words = f"{words} and {share} of the moment carried by the joint"
        power, saturation, peak = (values.get(name, 0.0) for name in ("exponent", "saturation", "peak"))
        if power > 0.0:
            return f"{words} that rises as the rate to the power of {text(power, stds.get('exponent'), '1')}"
        if saturation > 0.0:
            return f"{words} that fades below a rate of {text(saturation, stds.get('saturation'), 'rad/s')}"
        if peak > 0.0:
            std, rate = stds.get("peak"), text(values["peak_rate"], stds.get("peak_rate"), "rad/s")
            more = text(100.0 * peak, None if std is None else 100.0 * std, "%")
            return f"{words} and up to {more} more below a rate of {rate}"
        return words.removesuffix(",")

    def stands(self, stiffness: float) -> float:
        """The angle at which the spring's moment equals the friction at rest, rad; 0 if this friction vanishes."""
        return self.at_rest / stiffness if stiffness > 0.0 else 0.0

    @property
    def at_rest(self) -> float:
        """The friction that holds a body at rest without a load, N m; 0 if it vanishes with the rate."""
        rises = self.exponent > 0.0 or self.saturation > 0.0
        return 0.0 if rises else self.friction_moment * (1.0 + self.peak)

    def sliding(self, rate: Array) -> Array:
        """The friction at a steady rate without a load, when the contact has deflected fully, N m, shape (n,).

        Args:
            rate: positive rate, rad/s, shape (n,).
        """
        power = (rate / _UNCHANGED_AT) ** self.exponent
        rise = np.tanh(rate / self.saturation) if self.saturation > 0.0 else 1.0
        peak = 1.0 + self.peak * np.exp(-((rate / self.peak_rate) ** 2))
        return np.asarray(self.friction_moment * power * rise * peak, np.float64)

    @classmethod
    def on_runs(
        cls, runs: SettingsTable, stated: SettingsTable, effects: Sequence[Self], drawn: Sequence[Drawn]
    ) -> None:
        """Set the terms of the moment law."""
        del stated, drawn
        friction = cls.column(effects, "friction_moment")
        runs["friction_moment"][:] = friction
        acts = (friction != 0.0) | (cls.column(effects, "load") != 0.0)
        for term, own in CONTACT.items():
            runs[term][:] = np.where(acts, cls.column(effects, own), 0.0)
        runs["friction_peak_rate"][runs["friction_peak"] == 0.0] = 0.0


def friction_of(parameters: Mapping[str, float]) -> CoulombFriction:
    """The friction of a moment law.

    Args:
        parameters: of the law by name, in its units; the others are 0.
    """
    own = {name: parameters[term] for term, name in CONTACT.items() if parameters.get(term, 0.0) != 0.0}
    return CoulombFriction(parameters.get("friction_moment", 0.0), **own)
