"""Meanings of the symbols in a report, for a reader who does not know the field."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping

from identification.printing import COEFFICIENTS
from identification.show.numbers import unit_mark
from tunnel_sim.effects import known_effects

MEANINGS: Mapping[str, str] = {
    "Cnβ": "yaw-moment derivative ∂Cn/∂β: slope of the coefficient of the yaw moment with the angle. A positive "
    "one lowers the frequency [1/rad]",
    "Cnr": "yaw-damping derivative ∂Cn/∂(r l/V): its slope with the rate r = β̇. A negative one adds damping "
    "[1/rad]",
    "ωn": "natural frequency of small swings [rad/s]",
    "ζ": "damping ratio; 1 is critical damping [1]",
    "kp": "stiffness of the position servo of a joint [N m/rad]",
    "β": "yaw angle of the body about the rod; nose-right is positive [rad]",
    "β̇": "yaw rate, r [rad/s]",
    "Izz": "moment of inertia of body and support about the rod [kg m²]",
    "Kr": "stiffness of the torsion spring, as stated [N m/rad]",
    "Cr": "viscous damping of the rig without wind [N m s/rad]",
    "Ka": "stiffness of the air, ½ρV²Al Cnβ [N m/rad]",
    "Ca": "damping of the air, ½ρVAl² Cnr [N m s/rad]",
    "V": "wind speed [m/s]",
    "ρ": "air density [kg/m³]",
    "A": "frontal area of the body [m²]",
    "l": "reference length of the body [m]",
}
"""Symbols of the rig, each with its meaning and unit."""
_OF_OTHERS: Mapping[str, tuple[str, ...]] = {"½ρV²Al": ("ρ", "V", "A", "l"), "½ρVAl²": ("ρ", "V", "A", "l")}


def symbol_rows(
    causes: Collection[str], coefficients: Iterable[str], parameters: Iterable[str]
) -> list[tuple[str, str]]:
    """Symbols of coefficients and causes, and the symbols that explain them, with meaning and unit.

    Args:
        parameters: full names of the fitted parameters of the causes.
    """
    kinds = [kind for kind in known_effects() if kind.name in causes]
    texts = [COEFFICIENTS.get(name, name) for name in coefficients] + [kind.equation for kind in kinds]
    rows: dict[str, str] = {}
    while texts:
        text = texts.pop()
        for group, symbols in _OF_OTHERS.items():
            text += f" {' '.join(symbols)}" if group in text else ""
        for symbol, meaning in MEANINGS.items():
            if symbol not in rows and _holds(text, symbol):
                rows[symbol] = meaning
                texts.append(meaning)
    own, fitted = {}, {name.rpartition(".")[2] for name in parameters}
    for kind in kinds:
        for info in kind.parameters():
            if info.symbol not in MEANINGS and info.name in fitted and _holds(kind.equation, info.symbol):
                unit = f" [{unit_mark(info.unit)}]"
                own[info.symbol] = f"{info.meaning}{unit}, of {kind.name.replace('_', ' ')}"
    return [(symbol, rows[symbol]) for symbol in MEANINGS if symbol in rows] + list(own.items())


def _holds(text: str, symbol: str) -> bool:
    """Whether a text contains a symbol by itself: ``β`` is neither in ``Cnβ`` nor in ``β̇``."""
    return re.search(rf"(?<!\w){re.escape(symbol)}(?![\w\u0307\u0308])", text) is not None
