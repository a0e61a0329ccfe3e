"""An effect on the command line: ``name:parameter=value,parameter=value``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from tunnel_sim.vocabulary.errors import TunnelError

if TYPE_CHECKING:
    from tunnel_sim.vocabulary.plan import EffectSetting

_FORM = "write NAME:PARAMETER=VALUE, with a comma before each further PARAMETER=VALUE; see tunnel effects"


def parse_effect(text: str) -> EffectSetting:
    """Read the value of ``--effect``.

    Args:
        text: such as ``coulomb_friction:friction_moment=0.004``.

    Returns:
        Name and parameters; the registry checks whether they exist and are in range.

    Raises:
        TunnelError: when it does not have that form, or a value is not a number.
    """
    from tunnel_sim.vocabulary.plan import EffectSetting

    where = f"--effect {text}"
    name, _, rest = text.partition(":")
    values: dict[str, float] = {}
    for part in rest.split(",") if rest else []:
        parameter, equals, value = (piece.strip() for piece in part.partition("="))
        if not (parameter and equals and value):
            raise TunnelError(f"{part!r} is not PARAMETER=VALUE", where=where, remedy=_FORM)
        if parameter in values:
            raise TunnelError(f"{parameter} is given twice", where=where, remedy="give it once")
        try:
            values[parameter] = float(value)
        except ValueError:
            raise TunnelError(f"{value!r} is not a number", where=where, remedy=_FORM) from None
    if not name.strip():
        raise TunnelError("no effect is named", where=where, remedy=_FORM)
    return EffectSetting(name.strip(), values)
