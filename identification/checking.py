"""`check_estimator`: whether your own estimator follows the rules on which identify, scores and sweeps rely.

The campaigns are of the nominal model in closed form, with white noise. The accuracy of the values is not judged
here: ``tunnel score`` measures it. Wrong units and far too small deviations are found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from identification.estimate import PARAMETERS, Estimate, RunEstimate, Status
from identification.estimators import SUMMARIES, Estimator, make_estimator, takes_driven
from identification.returned import CAMPAIGN_UNITS, RUN_UNITS, checked_return
from identification.show.quantity import Quantity
from tunnel_sim.vocabulary.campaign import Campaign, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.dimensions import beside
from tunnel_sim.vocabulary.errors import TunnelError, own_traceback, raised_line
from tunnel_sim.vocabulary.inputs import Input
from tunnel_sim.vocabulary.record import Array, Record

if TYPE_CHECKING:
    from typing import Any

TRUTH = {"cn_beta": 0.49, "cn_r": -0.11, "yaw_inertia": 0.1014, "mechanical_damping": 0.012}
"""Coefficients of the campaigns, in SI units."""
_AREA, _LENGTH, _DENSITY = 0.036, 0.625, 1.204  # m², m, kg/m³
_NOISE, _ZERO = 5e-4, 0.004  # rad
_RATE, _DURATION = 250.0, 8.0  # Hz, s
_RELEASE = 0.35  # rad
_CONDITIONS = tuple(
    (spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 12.0, 24.0)
)  # N m/rad, m/s
_FAR = (
    # share of the truth: a wrong unit (a factor of 2π, 57, 60 or 100) is further off, a crude method is
    # nearer
    0.2
)
_DEVIATIONS = 6.0  # standard deviations by which a value may be off in addition
_FALSE_ALARMS = 1e-4  # false-alarm rate for a right estimator, over all tests of its deviations together
_REPEATS = 10  # number of campaigns with different noise
# maximum difference, in standard deviations, between answers for reordered runs, or with the sign inverted
_SAME = 1.0


@dataclass(frozen=True)
class _Subject:
    """The estimator under test, with checks of its answers against the rules."""

    estimator: Estimator

    def refuse(self, what: str, remedy: str) -> TunnelError:
        return TunnelError(what, where=f"estimator {self.estimator.name}", remedy=remedy)

    def estimate(self, campaign: Campaign, of: str) -> Estimate:
        """The estimator's answer, after checking the rules for every answer.

        Args:
            of: the kind of campaign, for messages.
        """
        before = [(run.record.time_s.copy(), run.record.yaw_rad.copy()) for run in campaign.runs]
        try:
            estimate = self.estimator.estimate(campaign)
        except (Exception, SystemExit) as error:
            what = f"raises an exception with {of}: {raised_line(error)}"
            remedy = "return an Estimate whose statuses say what failed"
            if "read-only" in str(error):
                remedy = "copy an array before you change it"
            elif isinstance(error, TunnelError):
                remedy = f"{remedy}; only bad input, such as wind without air density, is refused"
            refusal = self.refuse(what, remedy)
            refusal.add_note(own_traceback(error))
            raise refusal from error
        for run, (time, yaw) in zip(campaign.runs, before, strict=True):
            same = np.array_equal(time, run.record.time_s) and np.array_equal(yaw, run.record.yaw_rad)
            if not same:
                raise self.refuse(f"changes the record of run {run.id}", "copy an array before you change it")
        self._check_form(estimate, campaign, of)
        return estimate

    def _check_form(self, answer: object, campaign: Campaign, of: str) -> None:
        estimate = checked_return(answer, self.estimator.name, campaign, of)
        if (estimate.estimator, estimate.campaign) != (self.estimator.name, campaign.name):
            what = f"labels its estimate {estimate.estimator!r} of {estimate.campaign!r}"
            raise self.refuse(what, "write Estimate(campaign.name, self.name, runs, …)")
        self._check_deviations(estimate, CAMPAIGN_UNITS, f"with {of}")
        for run in estimate.runs:
            self._check_deviations(run, RUN_UNITS, f"of run {run.id} with {of}")
            self._check_statuses(run, f"run {run.id} with {of}")
        self._check_statuses(estimate, f"the campaign with {of}")

    def _check_deviations(self, owner: object, names: Iterable[str], of: str) -> None:
        for name in names:
            quantity: Quantity | None = getattr(owner, name)
            if quantity is not None and quantity.known_std <= 0.0:
                what = f"the standard deviation of {name} {of} is {quantity.std}"
                raise self.refuse(what, "give its uncertainty, which is above 0 with noise")

    def _check_statuses(self, owner: Estimate | RunEstimate, of: str) -> None:
        statuses = owner.statuses
        if Status.OK in statuses and len(statuses) > 1:
            raise self.refuse(
                f"{of} is OK and {statuses[0].name}", "leave Status.OK out where another is given"
            )
        nothing = isinstance(owner, RunEstimate) and not owner.identified
        if nothing and not owner.status.failed:
            what = f"{of} has neither a frequency nor a status that says why"
            raise self.refuse(what, "give omega_n, or a status such as Status.NO_OSCILLATION")
        if owner.status.failed and isinstance(owner, RunEstimate) and owner.identified:
            what = f"{of} has a value and the status {owner.status.name}"
            raise self.refuse(what, "give None for what failed")


def check_estimator(estimator: str | Estimator | type[Any], *, free_decays: bool = True) -> None:
    """Check your own estimator, as Gymnasium's ``check_env`` checks an environment.

    It must answer some thirty campaigns of two to six runs: complete ones, without wind, without stiffness, with a
    run that does not move, with noise alone, with missing samples, and with inputs if it states ``takes_driven``.
    Its answers must be complete and finite, in the stated units and with standard deviations; equal for the same
    runs, in another order and with the other sign; its failures must be statuses; and it must not change its input.

    Args:
        estimator: name, object, or class that needs no arguments.
        free_decays: False if the estimator takes driven runs only.

    Raises:
        TunnelError: for the first broken rule; the text says what to do. If the estimator raised an exception,
            its traceback is a note of the error.
    """
    subject = _Subject(_made(estimator))
    driven = takes_driven(subject.estimator)
    if not free_decays and not driven:
        what = "takes neither free decays nor driven runs"
        raise subject.refuse(what, "state takes_driven = True in its class")
    if free_decays:
        for check in _FREE:
            check(subject)
    if driven:
        _check_driven(subject)


def _made(estimator: object) -> Estimator:
    """The estimator as an object."""
    if isinstance(estimator, str):
        return make_estimator(estimator)
    where = f"estimator {getattr(estimator, 'name', estimator)!s}"
    if isinstance(estimator, type):
        try:
            estimator = estimator()
        except (Exception, SystemExit) as error:
            what = f"cannot be made without arguments: {raised_line(error)}"
            raise TunnelError(what, where=where, remedy="give each setting a default") from error
    name = getattr(estimator, "name", None)
    if not isinstance(name, str) or not name.isidentifier():
        what = f"its name is {name!r}"
        raise TunnelError(what, where=where, remedy='state name = "my_method", of letters, digits and _')
    if name in SUMMARIES and not type(estimator).__module__.startswith(__name__.partition(".")[0]):
        raise TunnelError("has the name of a packaged one", where=where, remedy="choose another name")
    if not callable(getattr(estimator, "estimate", None)):
        raise TunnelError("has no method estimate", where=where, remedy="write estimate(self, campaign)")
    return estimator  # type: ignore[return-value]  # what the protocol asks for has been looked at


def _check_values(subject: _Subject) -> None:
    """Units and deviations: values are near the truth, and equal for the same runs."""
    campaign = _campaign()
    estimate = subject.estimate(campaign, "noisy runs")
    truths = _truths()
    if not any(run.identified for run in estimate.runs):
        what = f"identifies none of six clean decays: {estimate.runs[0].status.name}"
        raise subject.refuse(what, "try it on tunnel score, and read its statuses")
    for run, truth in zip(estimate.runs, truths, strict=True):
        for name, true in truth.items():
            _compare(subject, f"{name} of run {run.id}", getattr(run, name), true)
    for name, true in TRUTH.items():
        _compare(subject, name, getattr(estimate, name), true)
    if subject.estimate(_campaign(), "noisy runs") != estimate:
        what = "gives a different answer for the same runs"
        raise subject.refuse(what, "make the generator in estimate: numpy.random.default_rng(self.seed)")


def _compare(subject: _Subject, name: str, quantity: Quantity | None, truth: float) -> None:
    if quantity is None:
        return
    if abs(quantity.value - truth) > _FAR * abs(truth) + _DEVIATIONS * quantity.known_std:
        value = f"{quantity.value:.4g} ± {quantity.std:.2g}{beside(quantity.unit)}"
        what = f"{name} is {value}, and the truth is {truth:.4g}"
        right = " and ".join(filter(None, (beside(quantity.unit, "is in "), "has its sign")))
        raise subject.refuse(what, f"check that it {right}")


def _check_same_runs(subject: _Subject) -> None:
    """The order of the runs, the sign and the zero of the sensor do not matter."""
    campaign = _campaign()
    estimate = subject.estimate(campaign, "noisy runs")
    turned = subject.estimate(replace(campaign, runs=campaign.runs[::-1]), "runs in reverse order")
    mirrored = subject.estimate(_changed(campaign, lambda _, yaw: 0.1 - yaw), "the other sign and zero")
    for other, runs, how in (
        (turned, turned.runs[::-1], "in another order"),
        (mirrored, mirrored.runs, "of the other sign and zero"),
    ):
        pairs = [(name, getattr(estimate, name), getattr(other, name)) for name in PARAMETERS]
        for run, same in zip(estimate.runs, runs, strict=True):
            pairs += [(f"{name} of run {run.id}", getattr(run, name), getattr(same, name)) for name in _RATES]
        for name, first, second in pairs:
            if (first is None) != (second is None) or (
                first and abs(first.value - second.value) > _SAME * first.std
            ):
                values = f"{getattr(first, 'value', None)} and {getattr(second, 'value', None)}"
                what = f"{name} is not the same for the same runs {how}: {values}"
                raise subject.refuse(what, "fit the zero, and use no run as the first")


_RATES = ("omega_n", "zeta")


def _check_deviations(subject: _Subject) -> None:
    """Values do not scatter by more than the stated deviations, beyond chance."""
    from scipy.stats import chi2

    estimates = [subject.estimate(_campaign(seed=seed), "noisy runs") for seed in range(1, _REPEATS + 1)]
    several = {name: [getattr(estimate, name) for estimate in estimates] for name in PARAMETERS}
    for place, run in enumerate(estimates[0].runs):
        several |= {
            f"{name} of run {run.id}": [getattr(estimate.runs[place], name) for estimate in estimates]
            for name in _RATES
        }
    known = {name: [quantity for quantity in some if quantity is not None] for name, some in several.items()}
    tested = {name: some for name, some in known.items() if len(some) == _REPEATS}
    if not tested:
        return
    most = chi2.isf(_FALSE_ALARMS / len(tested), _REPEATS - 1) / (_REPEATS - 1)
    for name, some in tested.items():
        spread = float(np.std([quantity.value for quantity in some], ddof=1))
        stated = float(np.sqrt(np.mean([quantity.std**2 for quantity in some])))
        if spread**2 > most * stated**2:
            what = (
                f"{name} scatters by {spread:.2g} {some[0].unit} with the noise, and {stated:.2g} is stated"
            )
            raise subject.refuse(what, "state a standard deviation that covers the noise of the record")


def _check_partial(subject: _Subject) -> None:
    """Campaigns that do not determine all coefficients, and missing samples."""
    whole = _campaign()
    still = replace(whole, runs=whole.in_still_air)
    unstated = replace(whole, runs=tuple(replace(run, spring_stiffness=None) for run in whole.runs))
    no_size = replace(whole, rig=RigProperties())
    single = replace(whole, runs=whole.runs[:1])
    rng = np.random.default_rng(3)
    holes = replace(
        whole,
        runs=tuple(replace(run, record=_thinned(run.record, rng)) for run in whole.runs),
    )
    for campaign, of, absent in (
        (still, "wind-off runs only", ("cn_beta", "cn_r")),
        (unstated, "runs without a stated spring", PARAMETERS),
        (no_size, "a rig without sizes", ("cn_beta", "cn_r")),
        (single, "one run", ("cn_beta", "cn_r")),
        (holes, "samples that are missing", ()),
    ):
        estimate = subject.estimate(campaign, of)
        for name in absent:
            if getattr(estimate, name) is not None:
                what = f"gives {name} with {of}, which do not determine it"
                raise subject.refuse(what, "give None, and a status such as Status.NO_WIND_ON")


def _check_failures(subject: _Subject) -> None:
    """A run that does not move fails alone; if all fail, so does the campaign."""
    whole, rng = _campaign(), np.random.default_rng(4)
    for of, level in (("runs that do not move", 0.0), ("runs of noise alone", _NOISE)):
        dead = _changed(whole, lambda time, _: _ZERO + level * rng.standard_normal(time.size))  # noqa: B023
        found = subject.estimate(replace(dead, runs=dead.runs[:2]), of)
        if not found.status.failed:
            what = f"reports {found.status.name} with {of}"
            raise subject.refuse(
                what, "give the campaign Status.NO_RUN_IDENTIFIED where no run was identified"
            )
        one = replace(whole, runs=(*whole.runs[:4], dead.runs[4], whole.runs[5]))
        some = subject.estimate(one, f"one of {of} among others")
        if not some.runs[4].status.failed:
            what = f"reports {some.runs[4].status.name} for one of {of}"
            raise subject.refuse(what, "give it Status.NO_OSCILLATION, and leave it out")
        if not some.runs[0].identified or some.status.failed:
            what = f"fails as a whole with one of {of} among others"
            raise subject.refuse(what, "leave that run out, and give Status.RUN_LEFT_OUT")
    short = tuple(
        replace(run, record=Record(run.record.time_s[:5], run.record.yaw_rad[:5])) for run in whole.runs
    )
    subject.estimate(replace(whole, runs=short), "records of five samples")


_FREE: Sequence[Callable[[_Subject], None]] = (
    _check_values,
    _check_same_runs,
    _check_partial,
    _check_failures,
    _check_deviations,
)


def _check_driven(subject: _Subject) -> None:
    """Runs under a known moment."""
    found = subject.estimate(_driven_campaign(), "driven runs")
    for name, true in TRUTH.items():
        _compare(subject, f"{name} of driven runs", getattr(found, name), true)
    for run, truth in zip(found.runs, _truths(), strict=True):
        for name, true in truth.items():
            _compare(subject, f"{name} of driven run {run.id}", getattr(run, name), true)
    if not any(run.identified for run in found.runs):
        what = f"states takes_driven, and identifies no driven run: {found.runs[0].status.name}"
        raise subject.refuse(what, "use run.drive, or leave takes_driven out")


def _motion(spring: float, speed: float) -> tuple[float, float]:
    """Damping and stiffness of a run over the inertia, 1/s and 1/s²."""
    pressure = 0.5 * _DENSITY * speed**2 * _AREA * _LENGTH
    per_speed = 0.5 * _DENSITY * speed * _AREA * _LENGTH**2
    damping = TRUTH["mechanical_damping"] - per_speed * TRUTH["cn_r"]
    return damping / TRUTH["yaw_inertia"], (spring - pressure * TRUTH["cn_beta"]) / TRUTH["yaw_inertia"]


def _truths() -> list[dict[str, float]]:
    """ωn [rad/s] and ζ of the runs."""
    found = []
    for damping, stiffness in (_motion(*one) for one in _CONDITIONS):
        omega = float(np.sqrt(stiffness))
        found.append({"omega_n": omega, "zeta": damping / (2.0 * omega)})
    return found


def _campaign(seed: int = 0) -> Campaign:
    """Six free decays of the nominal model in closed form, with white noise."""
    rng, time = np.random.default_rng(seed), np.arange(round(_DURATION * _RATE)) / _RATE
    runs = []
    for number, (spring, speed) in enumerate(_CONDITIONS, 1):
        damping, stiffness = _motion(spring, speed)
        sigma = 0.5 * damping
        omega = np.sqrt(stiffness - sigma**2)
        swing = np.exp(-sigma * time) * (np.cos(omega * time) + sigma / omega * np.sin(omega * time))
        yaw = _ZERO + _RELEASE * swing + _NOISE * rng.standard_normal(time.size)
        runs.append(_run(number, Record(time, yaw), spring, speed))
    return _of(runs)


def _driven_campaign() -> Campaign:
    """The same conditions from rest under a moment that sweeps through every resonance."""
    from scipy.signal import lsim

    rng, time = np.random.default_rng(5), np.arange(round(2.0 * _DURATION * _RATE)) / _RATE
    moment = 0.4 * np.sin(2.0 * np.pi * (1.0 * time + 0.5 * 0.2 * time**2))  # N m; 1 to 4.2 Hz
    runs = []
    for number, (spring, speed) in enumerate(_CONDITIONS, 1):
        damping, stiffness = _motion(spring, speed)
        system = (
            [[0.0, 1.0], [-stiffness, -damping]],
            [[0.0], [1.0 / TRUTH["yaw_inertia"]]],
            [[1.0, 0.0]],
            [[0.0]],
        )
        swing = np.asarray(lsim(system, moment, time)[1])
        yaw = _ZERO + swing + _NOISE * rng.standard_normal(time.size)
        run = _run(number, Record(time, yaw), spring, speed)
        runs.append(replace(run, release_angle=None, drive=Input("moment_nm", moment)))
    return _of(runs)


def _run(number: int, record: Record, spring: float, speed: float) -> Run:
    density = _DENSITY if speed else None
    return Run(f"r{number:02d}", record, speed, spring, density, _RELEASE)


def _of(runs: Sequence[Run]) -> Campaign:
    rig = RigProperties(frontal_area=_AREA, reference_length=_LENGTH)
    return Campaign("check", rig, SensorProperties(_RATE, None, _NOISE), tuple(runs))


def _changed(campaign: Campaign, change: Callable[[Array, Array], Array]) -> Campaign:
    runs = [
        replace(run, record=Record(run.record.time_s, change(run.record.time_s, run.record.yaw_rad.copy())))
        for run in campaign.runs
    ]
    return replace(campaign, runs=tuple(runs))


def _thinned(record: Record, rng: np.random.Generator) -> Record:
    """Nine tenths of the samples, at random."""
    kept = rng.uniform(size=record.time_s.size) < 0.9
    return Record(record.time_s[kept], record.yaw_rad[kept])
