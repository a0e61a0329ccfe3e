"""Errors of the environments, which Gymnasium's tools may also catch as ValueError."""

from __future__ import annotations

from tunnel_sim.vocabulary.errors import TunnelError


class EnvError(TunnelError, ValueError):
    """A bad argument, option or action of an environment, described in one line.

    Args:
        what: what is wrong, as a short clause.
        where: the argument, option or action concerned; empty when there is none.
        remedy: what to do about it.
    """


def as_env_error(error: TunnelError, where: str) -> EnvError:
    """Convert an error of a lower layer to an `EnvError`.

    Args:
        where: used where the error itself does not say what it concerns.
    """
    return EnvError(error.what, where=error.where or where, remedy=error.remedy)
