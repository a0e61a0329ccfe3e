"""`check_estimator`: what breaks a rule is named with its remedy; what keeps them passes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from identification import Estimate, Quantity, RunEstimate, Status, check_estimator
from identification.estimators import DRIVEN_ONLY, SUMMARIES
from identification.estimators.matrix_pencil import MatrixPencil
from tests.marks import slow
from tunnel_sim import Campaign, TunnelError

QUICK = ("conventional", "frequency_response")


@pytest.mark.parametrize("name", [name if name in QUICK else slow(name) for name in SUMMARIES])
def test_every_packaged_estimator_passes(name: str) -> None:
    check_estimator(name, free_decays=name not in DRIVEN_ONLY)


@dataclass(frozen=True)
class Pencil:
    """The matrix pencil with a fault planted in its answer, or in how it comes to it."""

    fault: Callable[[Estimate, Campaign], Any]
    name: str = "pencil"
    takes_driven: bool = False

    def estimate(self, campaign: Campaign) -> Any:
        found = replace(MatrixPencil().estimate(campaign), estimator=self.name)
        return self.fault(found, campaign)


def of_runs(**changes: Callable[[Quantity], Quantity | None]) -> Callable[[Estimate, Campaign], Estimate]:
    def fault(found: Estimate, _: Campaign) -> Estimate:
        runs = [
            replace(run, **{name: change(getattr(run, name)) for name, change in changes.items()})
            if run.identified
            else run
            for run in found.runs
        ]
        return replace(found, runs=tuple(runs))

    return fault


def scaled(factor: float, std: float | None = None) -> Callable[[Quantity], Quantity]:
    return lambda q: Quantity(q.value * factor, q.std * (factor if std is None else std), q.unit)


def changed_record(found: Estimate, campaign: Campaign) -> Estimate:
    campaign.runs[0].record.yaw_rad[0] = 0.0
    return found


def forced(found: Estimate, campaign: Campaign) -> Estimate:
    yaw = campaign.runs[0].record.yaw_rad
    yaw.flags.writeable = True
    yaw[0] += 1e-9
    return found


def drawn(found: Estimate, campaign: Campaign) -> Estimate:
    shift = np.random.default_rng().standard_normal()
    return of_runs(zeta=lambda q: replace(q, value=q.value + 0.1 * q.std * shift))(found, campaign)


def first_run_decides(found: Estimate, campaign: Campaign) -> Estimate:
    share = 1.0 + 1e-3 * campaign.runs[0].wind_speed
    return of_runs(omega_n=lambda q: replace(q, value=q.value * share))(found, campaign)


def not_a_number(found: Estimate, _: Campaign) -> Estimate:
    nan = Quantity(float("nan"), float("nan"), "rad/s")
    runs = [run if run.identified else RunEstimate(run.id, omega_n=nan) for run in found.runs]
    return replace(found, runs=tuple(runs))


def silent(found: Estimate, _: Campaign) -> Estimate:
    runs = [run if run.identified else RunEstimate(run.id) for run in found.runs]
    return replace(found, runs=tuple(runs))


def falls_on_silence(found: Estimate, campaign: Campaign) -> Estimate:
    if any(not np.ptp(run.record.yaw_rad) for run in campaign.runs):
        raise ZeroDivisionError("no swing")
    return found


def never_fails(found: Estimate, _: Campaign) -> Estimate:
    return replace(found, statuses=(Status.OK,))


def fails_whole(found: Estimate, campaign: Campaign) -> Estimate:
    if all(run.identified for run in found.runs):
        return found
    runs = tuple(RunEstimate(run.id, (Status.NOT_CONVERGED,)) for run in campaign.runs)
    return Estimate(campaign.name, found.estimator, runs, (Status.NO_RUN_IDENTIFIED,))


def guesses(found: Estimate, _: Campaign) -> Estimate:
    if found.cn_beta is not None or found.yaw_inertia is None:
        return found
    std = found.yaw_inertia.std
    return replace(
        found,
        cn_beta=Quantity(0.5, std, "1/rad"),
        parameters=("cn_beta", *found.parameters),
        covariance=tuple(map(tuple, np.diag([std**2, *np.diag(found.covariance_matrix)]))),
    )


def few_deviations(found: Estimate, campaign: Campaign) -> Estimate:
    return of_runs(zeta=scaled(1.0, std=0.3))(found, campaign)


FAULTS: dict[
    str, tuple[Callable[[Estimate, Campaign], Any], str]
] = {  # beside those of test_own_estimators.py
    "no estimate": (
        lambda found, _: found.to_json_dict(),
        "returns dict with noisy runs; return an ident",
    ),
    "unsigned": (lambda found, _: replace(found, estimator="x"), "labels its estimate 'x'"),
    "hertz without a word": (
        of_runs(omega_n=scaled(0.159)),
        "omega_n of run r01 is 2.*check that it is in rad/s",
    ),
    "per cent": (of_runs(zeta=scaled(100.0)), "zeta of run r01 is .*, and the truth is"),
    "no deviation": (
        of_runs(zeta=scaled(1.0, std=0.0)),
        "deviation of zeta .* is 0.0; give its uncertainty",
    ),
    "small deviations": (few_deviations, "zeta of run r0. scatters by .* and .* is stated"),
    "the input is changed": (changed_record, "read-only.*; copy an array before you change it"),
    "the input is forced": (forced, "changes the record of run r01; copy an array"),
    "not repeatable": (drawn, "a different answer for the same runs.*default_rng"),
    "the first run decides": (first_run_decides, "not the same for the same runs in another order"),
    "not a number": (not_a_number, "omega_n of run r01 .* is nan ± nan; give None and a status"),
    "silent": (silent, "neither a frequency nor a status that says why"),
    "an exception": (
        falls_on_silence,
        r"exception with .* do not move: ZeroDivisionError: no swing, test_checking\.py line",
    ),
    "never fails": (
        never_fails,
        "reports OK with runs that do not move; give the campaign Status",
    ),
    "fails as a whole": (fails_whole, "fails as a whole with one of .* among others"),
    "guesses": (guesses, "gives cn_beta with wind-off runs only"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_broken_rule_is_one_line_with_its_remedy(fault: str) -> None:
    planted, said = FAULTS[fault]
    with pytest.raises(TunnelError, match=f"estimator pencil: .*{said}") as refusal:
        check_estimator(Pencil(planted))
    assert "\n" not in str(refusal.value)


def test_an_exception_comes_with_its_traceback() -> None:
    with pytest.raises(TunnelError) as refusal:
        check_estimator(Pencil(falls_on_silence))
    (note,) = refusal.value.__notes__
    assert note.startswith("Traceback (most recent call last):\n")
    assert 'raise ZeroDivisionError("no swing")' in note


def test_leaving_the_program_is_an_exception() -> None:
    def leaves(_: Estimate, __: Campaign) -> Estimate:
        raise SystemExit(3)

    with pytest.raises(TunnelError, match=r"raises an exception with .*SystemExit: 3"):
        check_estimator(Pencil(leaves))


def test_the_same_without_a_fault_passes() -> None:
    check_estimator(Pencil(lambda found, _: found))


def test_only_frequencies_are_enough() -> None:
    """An estimator need not give coefficients, nor damping."""

    def bare(found: Estimate, campaign: Campaign) -> Estimate:
        runs = tuple(replace(run, zeta=None) for run in found.runs)
        return Estimate(campaign.name, found.estimator, runs, found.statuses)

    check_estimator(Pencil(bare))


def test_takes_driven_is_held_to_its_word() -> None:
    with pytest.raises(TunnelError, match="driven run"):
        check_estimator(Pencil(lambda found, _: found, takes_driven=True))
    with pytest.raises(TunnelError, match="takes neither free decays nor driven runs"):
        check_estimator(Pencil(lambda found, _: found), free_decays=False)


@pytest.mark.parametrize(
    ("made", "said"),
    [
        (Pencil, "estimator pencil: cannot be made without arguments"),
        (type("Nameless", (), {"estimate": print}), 'its name is None; state name = "my_method"'),
        (type("Odd", (), {"name": "odd"}), "has no method estimate"),
        (type("Double", (), {"name": "hilbert", "estimate": None}), "has the name of a packaged one"),
        ("hilbrt", "did you mean 'hilbert'"),
    ],
)
def test_what_is_no_estimator_is_said(made: Any, said: str) -> None:
    with pytest.raises(TunnelError, match=said):
        check_estimator(made)
