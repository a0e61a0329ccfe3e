"""The environments' own errors: lines for the user that Gymnasium's tools may also catch as ValueError."""

from __future__ import annotations

from tunnel_sim.vocabulary.errors import TunnelError


class EnvError(TunnelError, ValueError):
    """A bad argument, option or action of an environment, said in one line.

    Args:
        what: what is wrong, as a short clause.
        where: the argument, option or action it concerns; empty when there is none.
        remedy: what to do about it.
    """


def as_env_error(error: TunnelError, where: str) -> EnvError:
    """The same refusal as an environment's.

    Args:
        error: from a layer below.
        where: what it concerns, where the error itself does not say.

    Returns:
        The error to raise in its place.
    """
    return EnvError(error.what, where=error.where or where, remedy=error.remedy)
