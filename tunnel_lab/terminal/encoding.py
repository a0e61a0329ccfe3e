"""Standard output with a limited encoding: other characters are replaced by readable equivalents."""

from __future__ import annotations

import codecs
import json
import re
import sys

_ALIKE = {
    "±": "+/-", "−": "-", "–": "-", "—": "-", "×": "x", "·": ".", "⋅": ".", "…": "...", "≤": "<=", "≥": ">=",
    "≈": "~", "°": "deg", "²": "2", "³": "3", "⁻": "-", "¹": "1", "√": "sqrt", "∞": "inf", "µ": "u", "μ": "mu",
    "α": "alpha", "β": "beta", "γ": "gamma", "δ": "delta", "ε": "epsilon", "ζ": "zeta", "η": "eta", "θ": "theta",
    "κ": "kappa", "λ": "lambda", "ν": "nu", "ρ": "rho", "σ": "sigma", "τ": "tau", "φ": "phi", "χ": "chi",
    "ψ": "psi", "ω": "omega", "Δ": "Delta", "Σ": "Sigma", "Φ": "Phi", "Ω": "Omega", "π": "pi", "─": "-",
    "━": "-", "│": "|", "“": '"', "”": '"', "„": '"', "‘": "'", "’": "'", "→": "->", "←": "<-", "•": "*",
}  # fmt: skip
_HANDLER = "tunnel.alike"


def replace_what_cannot_be_encoded() -> None:
    """Let standard output and error replace characters beyond their encoding, instead of raising an error."""
    codecs.register_error(_HANDLER, _alike)
    for stream in (sys.stdout, sys.stderr):
        reconfigure = getattr(stream, "reconfigure", None)  # streams of tests and notebooks lack this method
        if reconfigure is not None:
            reconfigure(errors=_HANDLER)


def _alike(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    known = (
        _ALIKE.get(character, _escaped(character)) for character in error.object[error.start : error.end]
    )
    return "".join(known), error.end


def _escaped(character: str) -> str:
    return character.encode("ascii", "backslashreplace").decode("ascii")


def printable_json(text: str) -> str:
    """JSON with escapes for characters that standard output cannot encode; it parses to the same document."""
    encoding = getattr(sys.stdout, "encoding", None) or "utf-8"
    try:
        text.encode(encoding)
    except UnicodeEncodeError:
        return re.sub(r"[^\x00-\x7f]", lambda found: json.dumps(found[0])[1:-1], text)
    return text
