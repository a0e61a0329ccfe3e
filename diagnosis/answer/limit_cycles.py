"""The answer where every run is in a limit cycle: unknown, with what was recognised."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from diagnosis.attribution.decide import UNKNOWN
from diagnosis.result import Candidate, Coefficients, Diagnosis, Where
from identification.examination.self_excited import in_limit_cycle
from identification.status import Remark
from tunnel_sim.vocabulary.errors import TunnelError

_NOTE = "no damping ratio and no derivative is stated, since no run is a free decay"


def limit_cycle_answer(nominal: Diagnosis, remarks: Sequence[Remark]) -> Diagnosis:
    """Replace the answer by what the examination recognised.

    Args:
        nominal: the answer without effects, for the gap to a free decay and the noise.

    Returns:
        The answer ``unknown``, without coefficients, place or rest.
    """
    excess = nominal.gap.excess_before
    return replace(
        nominal,
        causes=UNKNOWN,
        verdict=f"No run is a free decay, so no cause is named. {_recognised(remarks)}.",
        where=Where(None, None, tuple(run.id for run in nominal.gap.runs)),
        candidates=(Candidate("unknown", 1.0, excess, 0.0),),
        coefficients=Coefficients({}, {}, _NOTE),
        inclusion={},
        blind_spots=(),
        rest=None,
    )


def refused_limit_cycles(remarks: Sequence[Remark]) -> TunnelError:
    """The refusal where not even the nominal model can be fitted to runs in a limit cycle.

    Returns:
        The error, which says what was recognised.
    """
    return TunnelError(
        f"no run is a free decay: {_recognised(remarks)}", remedy="add decays at a lower wind speed"
    )


def _recognised(remarks: Sequence[Remark]) -> str:
    return ". ".join(f"{r.runs[0]}: {r.what}" for r in remarks if in_limit_cycle(r.figures))
