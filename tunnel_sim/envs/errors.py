"""Errors of the environments, which Gymnasium's tools may also catch as ValueError."""

from __future__ import annotations

from tunnel_sim.vocabulary.errors import TunnelError


class EnvError(TunnelError, ValueError):
    """A bad argument, option or action of an environment, described in one line."""


def as_env_error(error: TunnelError, where: str) -> EnvError:
    """Convert an error of a lower layer to an `EnvError`, which concerns ``where`` if it does not say itself."""
    return EnvError(error.what, where=error.where or where, remedy=error.remedy)
