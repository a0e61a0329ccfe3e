"""A step to take next, with its gain."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NextStep:
    """A step for the rig.

    Args:
        what: to do, a sentence without its full stop.
        gain: what it buys, a clause such as ``removes 98 % of the gap``; empty where the step says so itself.
    """

    what: str
    gain: str = ""

    @property
    def words(self) -> str:
        """The step with its gain, a sentence."""
        return f"{self.what}{f': {self.gain}' if self.gain else ''}."
