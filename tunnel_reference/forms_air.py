"""Forms of the aerodynamic families: nonlinear moment and damping, lag, wind speed, turbulence, vortices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tunnel_reference import moments as m
from tunnel_reference.catalogue import (
    Draw,
    Extra,
    Form,
    Group,
    ParamMaker,
    calibration,
    lag_time,
    moving,
    speed_offset,
)
from tunnel_reference.integrator import Phase
from tunnel_reference.moments import turbulence, wandering_vortex
from tunnel_reference.true_conditions import WIDTH, Array, TrueConditions

T, C, R = Group.TEXTBOOK, Group.COMMON, Group.RARE
_BOTH = (-1, 1)

_MOMENT = (
    Form("nonlinear_yaw_moment", "cubic", T, "κa, 1/rad²", 0.3,
         moving(m.cubic_air, Phase.MOMENT, lambda p, _e, _c: {"kappa": p, "quintic": 0.0}), _BOTH),
    Form("nonlinear_yaw_moment", "saturation", C, "k, 1/rad", 0.1,
         moving(m.saturating_air, Phase.MOMENT, lambda p, _e, _c: {"k": p}), _BOTH, limits=(1e-9, 1.5)),
    Form("nonlinear_yaw_moment", "sine", C, "|κ|, 1/rad²", 0.3,
         moving(m.sine_air, Phase.MOMENT, lambda p, _e, _c: {"kappa": p})),
    Form("nonlinear_yaw_moment", "arctan", R, "κ, 1/rad²", 0.3,
         moving(m.tangent_air, Phase.MOMENT, lambda p, _e, _c: {"kappa": p}), _BOTH),
    Form("nonlinear_yaw_moment", "with_quintic", R, "κa, 1/rad²", 0.3,
         moving(m.cubic_air, Phase.MOMENT, lambda p, e, _c: {"kappa": p, "quintic": p * e["ratio"]}), _BOTH,
         draw=lambda g, _c: {"ratio": g.uniform(-4.0, 4.0)}),
    Form("nonlinear_yaw_damping", "square", T, "μa, 1/rad²", 1.0,
         moving(m.nonlinear_air_damping, Phase.MOMENT, lambda p, _e, _c: {"mu": p}), _BOTH),
    Form("nonlinear_yaw_damping", "absolute", C, "m, 1/rad", 0.5,
         moving(m.absolute_air_damping, Phase.MOMENT, lambda p, _e, _c: {"mu": p}), _BOTH),
    Form("nonlinear_yaw_damping", "saturating", R, "μ, 1/rad²", 1.0,
         moving(m.saturating_air_damping, Phase.MOMENT, lambda p, e, _c: {"mu": p, "bend": e["bend"]}), _BOTH,
         draw=lambda g, _c: {"bend": g.uniform(0.2, 0.5)}),
)  # fmt: skip


def _wagner(p: float, e: Extra, c: TrueConditions) -> dict[str, float | Array]:
    """Two time constants, p l/V and ``ratio`` times p l/V, with their weights."""
    return {"w1": e["w1"], "w2": 1.0 - e["w1"], "tau1": lag_time(p, c), "tau2": lag_time(p * e["ratio"], c)}


def _e_folds(c: TrueConditions) -> Array:
    """ln(V/V0) of every run, with the mean stated speed V0 of the runs with the wind on; 0 in still air."""
    mean = float(np.mean(c.wind_speed[c.wind_on])) if np.any(c.wind_on) else 1.0
    return np.log(np.where(c.wind_on, c.wind_speed, mean) / mean)


_SPEED = (
    Form("unsteady_aero_lag", "lag", T, "a, l/V", 0.2,
         moving(m.lag_one, Phase.ANGLE, lambda p, _e, c: {"w1": 1.0, "tau1": lag_time(p, c)}, states=1)),
    Form("unsteady_aero_lag", "lead", C, "|a|, l/V", 0.2,
         moving(m.lag_one, Phase.ANGLE, lambda p, _e, c: {"w1": -1.0, "tau1": lag_time(p, c)}, states=1)),
    Form("unsteady_aero_lag", "two_times", C, "a, l/V", 0.15,
         moving(m.lag, Phase.ANGLE, _wagner, states=2),
         draw=lambda g, _c: {"w1": g.uniform(0.4, 0.7), "ratio": g.uniform(3.0, 7.0)}),
    Form("unsteady_aero_lag", "cascade", R, "a, l/V", 0.2,
         moving(m.lag_cascade, Phase.ANGLE, lambda p, _e, c: {"tau1": lag_time(p, c)}, states=2)),
    Form("wind_speed_drift", "linear", T, "d", 0.005,
         moving(m.speed_drift, Phase.WIND,
                lambda p, _e, c: {"drift": p, "span": c.duration, "exponent": 1.0}), _BOTH),
    Form("wind_speed_drift", "settling", C, "d", 0.005,
         moving(m.speed_settling, Phase.WIND,
                lambda p, e, c: {"drift": p, "span": c.duration, "time": e["part"] * c.duration}), _BOTH,
         draw=lambda g, _c: {"part": g.uniform(0.2, 0.6)}),
    Form("wind_speed_drift", "power", R, "d", 0.005,
         moving(m.speed_drift, Phase.WIND,
                lambda p, e, c: {"drift": p, "span": c.duration, "exponent": e["exponent"]}), _BOTH,
         draw=lambda g, _c: {"exponent": g.choice([0.6, 1.6, 2.0])}),
    Form("wind_speed_offset", "constant", T, "ΔV, m/s", 0.03, calibration(speed_offset), _BOTH,
         draw=lambda _g, _c: {"exponent": 0.0}),
    Form("wind_speed_offset", "falling", C, "ΔV, m/s", 0.03, calibration(speed_offset), _BOTH,
         draw=lambda g, _c: {"exponent": g.uniform(0.2, 0.5)}),
    Form("reynolds_dependence", "logarithmic", T, "k", 0.01,
         calibration(lambda p, _e, c: replace(c, cn_beta_scale=1.0 + p * _e_folds(c))), _BOTH,
         limits=(1e-5, 1.0), edition=4),
    Form("reynolds_dependence", "power", C, "k", 0.01,
         calibration(lambda p, _e, c: replace(c, cn_beta_scale=np.exp(p * _e_folds(c)))), _BOTH,
         limits=(1e-5, 1.0), edition=4),
    Form("reynolds_dependence", "critical", R, "k", 0.01,
         calibration(lambda p, e, c: replace(
             c, cn_beta_scale=1.0 + p * e["width"] * np.tanh(_e_folds(c) / e["width"]))), _BOTH,
         draw=lambda g, _c: {"width": g.uniform(0.3, 1.0)}, limits=(1e-5, 1.0), edition=4),
    Form("flow_misalignment", "steady", T, "βf, rad", 0.01,
         moving(m.steady_moment, Phase.MOMENT, lambda p, _e, c: {"moment": c.air_stiffness * p}), _BOTH),
    Form("flow_misalignment", "speed_dependent", C, "βf, rad", 0.01,
         moving(m.steady_moment, Phase.MOMENT,
                lambda p, e, c: {"moment": c.air_stiffness * p * np.where(c.wind_on, c.true_speed / 20.0, 1.0)
                                 ** e["exponent"]}), _BOTH,
         draw=lambda g, _c: {"exponent": g.uniform(-0.6, 0.6)}),
)  # fmt: skip


def _turbulent(kind: str) -> ParamMaker:
    """A random moment of one kind of spectrum."""

    def make(p: float, e: Extra, c: TrueConditions) -> dict[str, float | Array]:
        series = turbulence(kind, c, seed=int(e["seed"]), scale=e["scale"])
        return {"table": p * c.reference_moment[:, None] * series}

    return make


def _seeded(low: float, high: float) -> Draw:
    """A seed and a scale."""
    return lambda g, _c: {"seed": float(g.integers(0, 2**31)), "scale": g.uniform(low, high)}


def _vortex(p: float, e: Extra, c: TrueConditions) -> dict[str, float | Array]:
    """A line at St V/width, with a phase drawn per run."""
    phase = np.random.default_rng(int(e["seed"])).uniform(0.0, 2.0 * np.pi, c.runs)
    return {
        "moment": p * c.reference_moment,
        "frequency": e["strouhal"] * c.true_speed / WIDTH,
        "phase": phase,
        "second": e["second"],
    }


def _wander(p: float, e: Extra, c: TrueConditions) -> dict[str, float | Array]:
    """A line whose phase is a random walk."""
    wave = wandering_vortex(c, seed=int(e["seed"]), strouhal=e["strouhal"], wander=e["wander"])
    return {"table": p * c.reference_moment[:, None] * wave}


def _strouhal(second: bool, wander: bool) -> Draw:
    """Strouhal number, seed, and the parameters of the form."""

    def draw(g: np.random.Generator, _c: TrueConditions) -> dict[str, float]:
        return {"seed": float(g.integers(0, 2**31)), "strouhal": float(g.uniform(0.1, 0.22)),
                "second": float(g.uniform(0.15, 0.4)) if second else 0.0,
                "wander": float(g.uniform(0.1, 0.8)) if wander else 0.0}  # fmt: skip

    return draw


_FORCING = (
    Form("buffeting", "band", T, "s", 0.003, moving(m.tabled_moment, Phase.MOMENT, _turbulent("band")),
         draw=_seeded(15.0, 60.0)),
    Form("buffeting", "dryden", C, "s", 0.003, moving(m.tabled_moment, Phase.MOMENT, _turbulent("dryden")),
         draw=_seeded(0.15, 1.0)),
    Form("buffeting", "von_karman", C, "s", 0.003,
         moving(m.tabled_moment, Phase.MOMENT, _turbulent("von_karman")), draw=_seeded(0.2, 1.5)),
    Form("buffeting", "narrow", R, "s", 0.003, moving(m.tabled_moment, Phase.MOMENT, _turbulent("octave")),
         draw=_seeded(3.0, 8.0)),
    Form("vortex_shedding", "line", T, "c", 0.01, moving(m.harmonic_moment, Phase.MOMENT, _vortex),
         draw=_strouhal(False, False)),
    Form("vortex_shedding", "second_harmonic", C, "c", 0.01, moving(m.harmonic_moment, Phase.MOMENT, _vortex),
         draw=_strouhal(True, False)),
    Form("vortex_shedding", "wandering", R, "c", 0.01, moving(m.tabled_moment, Phase.MOMENT, _wander),
         draw=_strouhal(False, True)),
)  # fmt: skip

FORMS: tuple[Form, ...] = (*_MOMENT, *_SPEED, *_FORCING)
