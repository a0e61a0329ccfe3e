"""Terms of the moment law as expressions of angle ``b`` (rad) and rate ``r`` (rad/s).

Each has the coefficient without which there is none, the effect in words, and the moment (N m).
"""

from __future__ import annotations

OF_ANGLE = (
    (
        "stiffness_cubic",
        "cubic stiffness",
        "-Kr*stiffness_cubic*0.2^3*abs(b/0.2)^stiffness_cubic_exponent*sign(b)",
    ),
    (
        "stiffness_quadratic",
        "asymmetric stiffness",
        "-Kr*stiffness_quadratic*0.2^2*abs(b/0.2)^stiffness_quadratic_exponent",
    ),
    ("free_play", "free play", "Kr*max(-free_play, min(free_play, b))"),
    (
        "gravity_stiffness",
        "gravity stiffness",
        "-gravity_stiffness*sin(b-gravity_angle)",
    ),
)
OF_RATE = (
    (
        "quadratic_damping",
        "quadratic damping",
        "-quadratic_damping*2^2*abs(r/2)^quadratic_damping_exponent*sign(r)",
    ),
)
TEXTBOOK_POWERS = {
    "stiffness_cubic_exponent": 3.0,
    "stiffness_quadratic_exponent": 2.0,
    "quadratic_damping_exponent": 2.0,
}
