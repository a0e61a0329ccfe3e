"""The runs of a campaign by input and wind."""

from __future__ import annotations

from typing import Generic, Protocol, TypeVar


class _Conditions(Protocol):
    @property
    def wind_on(self) -> bool: ...

    @property
    def drive(self) -> object | None: ...


R = TypeVar("R", bound=_Conditions)


class RunGroups(Generic[R]):
    """Runs of one kind, and the groups among them in the order of the runs."""

    runs: tuple[R, ...]

    @property
    def driven_runs(self) -> tuple[R, ...]:
        """The runs with an input."""
        return tuple(run for run in self.runs if run.drive is not None)

    @property
    def decays(self) -> tuple[R, ...]:
        """The free decays: the runs without an input."""
        return tuple(run for run in self.runs if run.drive is None)

    @property
    def driven(self) -> bool:
        """Whether any run has an input."""
        return bool(self.driven_runs)

    @property
    def in_wind(self) -> tuple[R, ...]:
        """The runs with the wind on."""
        return tuple(run for run in self.runs if run.wind_on)

    @property
    def in_still_air(self) -> tuple[R, ...]:
        """The runs with the wind off."""
        return tuple(run for run in self.runs if not run.wind_on)
