"""The balance at the release: the body is held at its angle, at rest, and its rod is in balance with the spring.

With a rod of compliance c and a spring Kr, the body's angle is 1 + Kr c times that of the spring's end.
"""

from __future__ import annotations

import dataclasses

from tunnel_sim.physics.run_settings import RunSettings


def spring_end_angle(run: RunSettings) -> float:
    """Angle of the spring's and sensor's end at the release.

    Args:
        run: its release angle is the body's.

    Returns:
        rad; the body's own angle where the rod is rigid.
    """
    return run.release_angle / _body_per_end(run)


def released_by_spring_end(run: RunSettings) -> RunSettings:
    """The run with the body's release angle, given that of the spring's and sensor's end.

    Args:
        run: its release angle is that of the spring's end, which is what a record shows.

    Returns:
        The same run, its release angle that of the body.
    """
    if run.rod_twist is None:
        return run
    return dataclasses.replace(run, release_angle=run.release_angle * _body_per_end(run))


def _body_per_end(run: RunSettings) -> float:
    """The body's angle over that of the spring's end, in balance; 1 for a rigid rod."""
    twist = run.rod_twist
    return 1.0 if twist is None else 1.0 + run.spring_stiffness * twist.compliance
