"""Forms of the mechanical families: friction, damping, spring, gravity, rod and spring calibration."""

from __future__ import annotations

import numpy as np

from tunnel_reference import moments as m
from tunnel_reference.catalogue import Draw, Extra, Form, Group, calibration, flexible_rod, moving, one_spring
from tunnel_reference.integrator import Phase
from tunnel_reference.true_conditions import Array, TrueConditions

T, C, R = Group.TEXTBOOK, Group.COMMON, Group.RARE
_BOTH = (-1, 1)
_ELEMENTS = np.geomspace(1.0 / (2 * np.pi * 200.0), 1.0 / (2 * np.pi * 0.05), 12)


def _maxwell(p: float, _e: Extra, c: TrueConditions) -> dict[str, float | Array]:
    """Moduli (2ηKr/π) Δln τ, and their elastic part at ωn."""
    modulus = 2.0 * p * c.true_stiffness / np.pi * np.log(_ELEMENTS[1] / _ELEMENTS[0])
    square = (c.wind_off_omega[:, None] * _ELEMENTS) ** 2
    return {
        "modulus": modulus,
        "times": np.tile(_ELEMENTS, (c.runs, 1)),
        "static": modulus * (square / (1.0 + square)).sum(axis=1),
    }


def _poly(k2: float = 0, k3: float = 0, k4: float = 0, k5: float = 0) -> dict[str, float | Array]:
    """Coefficients of the polynomial spring."""
    return {"k2": k2, "k3": k3, "k4": k4, "k5": k5}


_FRICTION = (
    Form("coulomb_friction", "sign", T, "Tc, N m", 0.003,
         moving(m.coulomb_level, Phase.FRICTION, lambda p, _e, _c: {"moment": p})),
    Form("coulomb_friction", "stribeck", C, "Tc, N m", 0.003,
         moving(m.stribeck_level, Phase.FRICTION,
                lambda p, e, _c: {"moment": p, "breakaway": e["breakaway"], "speed": e["speed"]}),
         draw=lambda g, _c: {"breakaway": g.uniform(0.2, 0.7), "speed": g.uniform(0.03, 0.15)}),
    Form("coulomb_friction", "tanh", C, "Tc, N m", 0.003,
         moving(m.tanh_friction, Phase.MOMENT, lambda p, e, _c: {"moment": p, "speed": e["speed"]}),
         draw=lambda g, _c: {"speed": g.uniform(0.005, 0.04)}),
    Form("coulomb_friction", "sublinear", C, "Tc, N m", 0.003,
         moving(m.sublinear_level, Phase.FRICTION,
                lambda p, e, _c: {"moment": p, "exponent": e["exponent"]}),
         draw=lambda g, _c: {"exponent": g.uniform(0.15, 0.6)}, edition=3),
    Form("coulomb_friction", "dahl", R, "Tc, N m", 0.003,
         moving(m.dahl_friction, Phase.MOMENT, lambda p, e, _c: {"moment": p, "slide": e["slide"]},
                states=1, at_release=False),
         draw=lambda g, _c: {"slide": g.uniform(0.005, 0.012)}),
    Form("coulomb_friction", "loaded", R, "Tc, N m", 0.003,
         moving(m.loaded_level, Phase.FRICTION, lambda p, e, _c: {"moment": p, "share": e["share"]}),
         draw=lambda g, _c: {"share": g.uniform(0.02, 0.2)}, driven=True, edition=3),
)  # fmt: skip

_DAMPING = (
    Form("quadratic_damping", "square", T, "C2, N m s²", 0.0005,
         moving(m.quadratic_damping, Phase.MOMENT, lambda p, _e, _c: {"coefficient": p})),
    Form("quadratic_damping", "power", C, "C, N m s^n", 0.0005,
         moving(m.power_damping, Phase.MOMENT,
                lambda p, e, _c: {"coefficient": p, "exponent": e["exponent"]}),
         draw=lambda g, _c: {"exponent": g.choice([1.75, 1.8, 1.9, 2.15])}),
    Form("quadratic_damping", "with_cubic", R, "C2, N m s²", 0.0005,
         moving(m.mixed_quadratic_damping, Phase.MOMENT,
                lambda p, e, _c: {"coefficient": p, "cubic": e["cubic"]}),
         draw=lambda g, _c: {"cubic": g.uniform(0.02, 0.08)}),
    Form("structural_damping", "equivalent", T, "η", 0.002,
         moving(m.viscous, Phase.MOMENT,
                lambda p, _e, c: {"coefficient": p * c.true_stiffness / c.wind_off_omega})),
    Form("structural_damping", "reid", C, "η", 0.002,
         moving(m.reid_level, Phase.FRICTION, lambda p, _e, _c: {"loss": p})),
    Form("structural_damping", "maxwell", R, "η", 0.002,
         moving(m.maxwell_elements, Phase.MOMENT, _maxwell, states=_ELEMENTS.size)),
)  # fmt: skip

_SPRING = (
    Form("cubic_stiffness", "cubic", T, "κ, 1/rad²", 0.02,
         moving(m.polynomial_spring, Phase.MOMENT, lambda p, _e, _c: _poly(k3=p)), _BOTH),
    Form("cubic_stiffness", "with_quintic", C, "κ, 1/rad²", 0.02,
         moving(m.polynomial_spring, Phase.MOMENT, lambda p, e, _c: _poly(k3=p, k5=p * e["ratio"])), _BOTH,
         draw=lambda g, _c: {"ratio": g.uniform(-4.0, 4.0)}),
    Form("cubic_stiffness", "tanh", C, "κ, 1/rad²", 0.02,
         moving(m.tanh_spring, Phase.MOMENT, lambda p, _e, _c: {"kappa": p}), _BOTH),
    Form("cubic_stiffness", "sine", R, "κ, 1/rad²", 0.02,
         moving(m.sine_spring, Phase.MOMENT, lambda p, _e, _c: {"kappa": p})),
    Form("asymmetric_stiffness", "square", T, "κ, 1/rad", 0.02,
         moving(m.polynomial_spring, Phase.MOMENT, lambda p, _e, _c: _poly(k2=p)), _BOTH),
    Form("asymmetric_stiffness", "bilinear", C, "e, stiffness ratio", 0.02,
         moving(m.bilinear_spring, Phase.MOMENT, lambda p, _e, _c: {"difference": p}), _BOTH),
    Form("asymmetric_stiffness", "with_quartic", R, "κ, 1/rad", 0.02,
         moving(m.polynomial_spring, Phase.MOMENT, lambda p, e, _c: _poly(k2=p, k4=p * e["ratio"])), _BOTH,
         draw=lambda g, _c: {"ratio": g.uniform(-3.0, 3.0)}),
    Form("free_play", "gap", T, "δ, rad", 0.0003,
         moving(m.dead_zone, Phase.ANGLE, lambda p, _e, _c: {"half": p, "left": 0.0, "centre": 0.0})),
    Form("free_play", "soft_edges", C, "δ, rad", 0.0003,
         moving(m.soft_dead_zone, Phase.ANGLE, lambda p, e, _c: {"half": p, "edge": e["edge"]}),
         draw=lambda g, _c: {"edge": g.uniform(0.1, 0.4)}),
    Form("free_play", "partial", C, "δ, rad", 0.0004,
         moving(m.dead_zone, Phase.ANGLE, lambda p, e, _c: {"half": p, "left": e["left"], "centre": 0.0}),
         draw=lambda g, _c: {"left": g.uniform(0.1, 0.4)}),
    Form("free_play", "tanh", R, "δ, rad", 0.0003,
         moving(m.tanh_dead_zone, Phase.ANGLE, lambda p, _e, _c: {"half": p})),
    Form("gravity_stiffness", "pendulum", T, "Kg, N m/rad", 0.01,
         moving(m.gravity, Phase.MOMENT,
                lambda p, e, _c: {"stiffness": p, "angle": e["angle"], "second": 0.0}), _BOTH,
         draw=lambda g, _c: {"angle": g.uniform(-0.3, 0.3)}),
    Form("gravity_stiffness", "two_harmonics", C, "Kg, N m/rad", 0.01,
         moving(m.gravity, Phase.MOMENT,
                lambda p, e, _c: {"stiffness": p, "angle": e["angle"], "second": e["second"]}), _BOTH,
         draw=lambda g, _c: {"angle": g.uniform(-0.3, 0.3), "second": g.uniform(-0.3, 0.3)}),
)  # fmt: skip


def _rod_draw(low: float, high: float, held: float, damping: float) -> Draw:
    """Inertia share of the upper end, damping of the twist, and the end held until the release."""

    def draw(g: np.random.Generator, _c: TrueConditions) -> dict[str, float]:
        return {"share": float(g.uniform(low, high)), "damping_ratio": float(g.uniform(0.2, 1.0)) * damping,
                "hardening": 0.0, "held_body": held}  # fmt: skip

    return draw


_ROD = (
    Form("rod_flexibility", "two_masses", T, "1/Krod, rad/(N m)", 1e-5, calibration(flexible_rod),
         draw=_rod_draw(0.02, 0.2, 1.0, 0.02), limits=(2e-7, 2e-2)),
    Form("rod_flexibility", "held_at_top", C, "1/Krod, rad/(N m)", 1e-5, calibration(flexible_rod),
         draw=_rod_draw(0.02, 0.2, 0.0, 0.02), limits=(2e-7, 2e-2)),
    Form("rod_flexibility", "heavy_top", R, "1/Krod, rad/(N m)", 1e-5, calibration(flexible_rod),
         draw=_rod_draw(0.2, 0.4, 1.0, 0.08), limits=(2e-7, 2e-2)),
    Form("spring_miscalibration", "one_spring", T, "x", 1e-3, calibration(one_spring), _BOTH,
         draw=lambda g, _c: {"spring": float(g.integers(0, 12))}),
)  # fmt: skip

FORMS: tuple[Form, ...] = (*_FRICTION, *_DAMPING, *_SPRING, *_ROD)
