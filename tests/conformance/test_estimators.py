"""One suite over every estimator of the registry: what any of them must do, whatever its method."""

import json
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest

from identification import Estimate, Status, identify
from identification.estimators import ALL_ESTIMATORS, SUMMARIES, make_estimator
from identification.examination.examine import examine
from identification.status import Outcome
from tests.marks import slow
from tests.reference.free_decays import RESOLUTION, TWELVE, Setting, Truth, angle_of, campaign, with_records
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.record import Record

NAMES = ("cn_beta", "cn_r", "yaw_inertia", "mechanical_damping")
# Relative error on a noise-free campaign of the nominal model, where it is not ORDINARY_ACCURACY.
ORDINARY_ACCURACY = 1e-3
ACCURACY = {
    "output_error": 1e-6,
    "conventional": 0.02,
    "neural_network": 1e-3,  # the second network's error of 4e-5 in ωn, ten times as large in a difference of ωn²
    "matrix_pencil": 1e-6,
    "log_decrement": 1e-4,
    "hilbert": 2e-5,
    "filter_error": 1e-6,
    "bayesian": 1e-6,
    "neural_posterior": 1e-5,  # first order in the departures from its windows
}

each_estimator = pytest.mark.parametrize("name", ALL_ESTIMATORS)


@pytest.fixture(scope="module", autouse=True)
def examined_once():
    """The examination of a campaign is the same for every estimator, and takes half of the time."""
    kept = {}  # with the campaigns, so that no other object takes the place of one

    def once(campaign):
        if id(campaign) not in kept:
            kept[id(campaign)] = campaign, examine(campaign)
        return kept[id(campaign)][1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("identification.identifying.examine", once)
        yield


whole_campaign = cache(partial(campaign, rate=250.0))


def noisy_campaign(**options):
    rng = np.random.default_rng(11)
    return campaign(TWELVE[:6], noise=5e-4, resolution=RESOLUTION, rate=250.0, rng=rng, **options)


@pytest.fixture(scope="module")
def noisy():
    return noisy_campaign()


@pytest.fixture(scope="module")
def of_noisy(noisy):
    """The estimate of an estimator from the noisy campaign, made once: many tests compare another one with it."""
    return cache(lambda name: identify(noisy, name))


@pytest.fixture(scope="module")
def turned(noisy):
    """The noisy campaign with its runs in reverse order."""
    return replace(noisy, runs=noisy.runs[::-1])


@pytest.fixture(scope="module")
def mirrored(noisy):
    """The noisy campaign with the other sign and another zero."""
    return with_records(noisy, lambda _, yaw: 0.1 - yaw)


@pytest.fixture(scope="module")
def dead_run(noisy):
    """The noisy campaign with one run that does not move."""
    swing = noisy.runs[4].record
    dead = replace(noisy.runs[4], record=replace(swing, yaw_rad=np.zeros_like(swing.yaw_rad)))
    return replace(noisy, runs=(*noisy.runs[:4], dead, *noisy.runs[5:]))


@pytest.fixture(scope="module")
def uneven(noisy):
    """Each run keeps nine tenths of its samples, at random, and loses 30 ms at once."""
    rng = np.random.default_rng(12)
    runs = []
    for run in noisy.runs:
        time = run.record.time_s
        kept = (rng.uniform(size=time.size) < 0.9) & ((time < 1.0) | (time > 1.03))
        runs.append(replace(run, record=Record(time[kept], run.record.yaw_rad[kept])))
    return replace(noisy, runs=tuple(runs))


def accuracy(name):
    return ACCURACY.get(name, ORDINARY_ACCURACY)


def numbers(value):
    """Every number in a JSON document."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [number for item in value for number in numbers(item)]
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else []


def checked(estimate, data):
    """The laws every estimate obeys, whatever it found."""
    document = estimate.to_json_dict()
    text = json.dumps(document, allow_nan=False)  # refuses NaN and infinity
    assert all(np.isfinite(numbers(document)))
    assert Estimate.from_json_dict(json.loads(text)) == estimate
    assert [run.id for run in estimate.runs] == [run.id for run in data.runs]
    for run, found in zip(data.runs, estimate.runs, strict=True):
        assert (found.omega_n is None) == (found.zeta is None)
        assert (found.omega_n is None) == found.status.failed
        assert found.aerodynamic_stiffness is None or run.wind_on
    given = tuple(name for name in NAMES if getattr(estimate, name) is not None)
    assert set(estimate.parameters) == set(given)
    matrix = estimate.covariance_matrix
    for i, name in enumerate(estimate.parameters):
        quantity = getattr(estimate, name)
        assert quantity.std > 0.0
        assert np.sqrt(matrix[i, i]) == pytest.approx(quantity.std)
    if given:
        assert np.linalg.eigvalsh(matrix / np.sqrt(np.outer(np.diag(matrix), np.diag(matrix))))[0] > -1e-9
    if len(given) < len(NAMES):
        assert estimate.status is not Status.OK
    assert Status.OK not in estimate.statuses or estimate.statuses == (Status.OK,)
    return estimate


def test_registry_is_explicit_and_consistent():
    assert set(ACCURACY) <= set(ALL_ESTIMATORS)
    for name in ALL_ESTIMATORS:
        assert make_estimator(name).name == name
    for summary in SUMMARIES.values():
        assert 20 < len(summary) < 120


@each_estimator
def test_recovers_the_truth_from_noise_free_records(name):
    data = whole_campaign()
    estimate = checked(identify(data, name), data)
    assert estimate.estimator == name
    assert estimate.statuses == (Status.OK,)
    for quantity in NAMES:
        truth = getattr(Truth(), quantity)
        assert getattr(estimate, quantity).value == pytest.approx(truth, rel=accuracy(name))
    assert estimate.wind_off_inertia.value == pytest.approx(Truth().yaw_inertia, rel=accuracy(name))


@each_estimator
@pytest.mark.slow
@pytest.mark.parametrize("nominal", [None, 0.13])
def test_nominal_inertia_decides_nothing(name, nominal, noisy, of_noisy):
    stated = replace(noisy, rig=replace(noisy.rig, yaw_inertia=nominal))
    assert identify(stated, name) == of_noisy(name)


@each_estimator
def test_noisy_records_are_identified_within_their_own_deviations(name, noisy, of_noisy):
    estimate = checked(of_noisy(name), noisy)
    for quantity in NAMES:
        found, truth = getattr(estimate, quantity), getattr(Truth(), quantity)
        # Six deviations, and the method's own stated error where it is not unbiased.
        allowed = 6.0 * found.std + accuracy(name) * abs(truth)
        assert abs(found.value - truth) < allowed


@each_estimator
def test_same_input_same_answer_and_input_untouched(name, noisy, of_noisy):
    assert not noisy.runs[0].record.yaw_rad.flags.writeable
    again = noisy_campaign()  # examined again, too
    assert identify(again, name) == of_noisy(name)
    for run, untouched in zip(again.runs, noisy_campaign().runs, strict=True):
        np.testing.assert_array_equal(run.record.yaw_rad, untouched.record.yaw_rad)


@each_estimator
def test_order_of_runs_does_not_matter(name, of_noisy, turned):
    plain, back = of_noisy(name), identify(turned, name)
    for quantity in NAMES:
        one, other = getattr(plain, quantity), getattr(back, quantity)
        assert other.value == pytest.approx(one.value, rel=1e-9)


@each_estimator
def test_sensor_zero_and_sign_do_not_matter(name, of_noisy, mirrored):
    plain, other = of_noisy(name), identify(mirrored, name)
    for quantity in NAMES:
        assert getattr(other, quantity).value == pytest.approx(getattr(plain, quantity).value, rel=1e-6)


TWO_SPRINGS = tuple(Setting(spring, speed) for spring in (16.12, 44.84) for speed in (0.0, 24.0))
CONTRADICTIONS = {
    "one spring of two 10 % low": (
        TWO_SPRINGS,
        lambda run: {"spring_stiffness": SOFTER[run.spring_stiffness]},
    ),
    "one spring of three 10 % low": (
        TWELVE[:9],
        lambda run: {"spring_stiffness": SOFTER[run.spring_stiffness]},
    ),
    "wind on and off exchanged": (TWO_SPRINGS, lambda run: {"wind_speed": 24.0 - run.wind_speed}),
}
#: Where the air does not damp, damping does not say which runs have the wind on: an exchange is not refused.
TRUTHS = {"wind on and off exchanged": replace(Truth(), cn_r=0.0)}
SOFTER = {16.12: 16.12, 21.02: 21.02, 44.84: 40.36}


@cache
def contradictory(case):
    settings, change = CONTRADICTIONS[case]
    rng, truth = np.random.default_rng(5), TRUTHS.get(case)
    data = campaign(settings, truth=truth, noise=5e-4, rng=rng, duration=6.0, rate=250.0)
    return replace(data, runs=tuple(replace(run, **change(run)) for run in data.runs))


@each_estimator
@pytest.mark.parametrize("case", [slow(c) if "three" in c else c for c in CONTRADICTIONS])
def test_a_contradiction_that_is_said_widens_the_intervals(name, case):
    estimate = checked(identify(contradictory(case), name, throw=False), contradictory(case))
    (remark, *others) = estimate.remarks
    assert remark.outcome is Outcome.NOTED
    assert all(other.what.endswith("so the result is that of output error") for other in others)
    if estimate.status.failed:  # a method may refuse instead
        assert estimate.parameters == ()
        return
    for quantity in NAMES:
        found, truth = getattr(estimate, quantity), getattr(TRUTHS.get(case, Truth()), quantity)
        assert abs(found.value - truth) < 2.58 * found.std + accuracy(name) * abs(truth)  # 99 %
        if found.interval is not None:
            assert found.interval[0] < truth < found.interval[1]
    for run in estimate.runs:
        if run.aerodynamic_stiffness is not None:
            assert run.aerodynamic_stiffness.std > 0.02 * abs(run.aerodynamic_stiffness.value)


@each_estimator
@pytest.mark.parametrize("slip", [1e3, slow(1.0 / 3600.0)])
def test_coefficients_are_withheld_where_the_springs_contradict_the_inertia_by_decades(name, slip):
    settings = TWO_SPRINGS[::2]
    data = campaign(settings, noise=5e-4, rng=np.random.default_rng(5), duration=6.0, rate=250.0)
    stated = replace(data, rig=replace(data.rig, yaw_inertia=Truth().yaw_inertia / slip))
    found = identify(stated, name, throw=False)
    assert Status.COEFFICIENTS_WITHHELD in found.statuses
    assert found.yaw_inertia is found.cn_beta is None
    kept = replace(stated, sensor=replace(stated.sensor, plausible=False))
    assert identify(kept, name) == identify(data, name)


PARTIAL = {
    "wind-off only": (
        (Setting(16.12, 0.0), Setting(44.84, 0.0)),
        {},
        Status.NO_WIND_ON,
        ("yaw_inertia", "mechanical_damping"),
    ),
    "one wind-off run": (
        (Setting(16.12, 0.0),),
        {},
        Status.NO_WIND_ON,
        ("yaw_inertia", "mechanical_damping"),
    ),
    "no size": (TWELVE[:6], {"has_size": False}, Status.NO_REFERENCE_SIZE, ("yaw_inertia",)),
    "no stiffness": ((Setting(None, 0.0), Setting(None, 12.0)), {}, Status.NO_STIFFNESS, ()),
    "one spring": (TWELVE[:3], {}, None, NAMES),
    "one speed": ((Setting(16.12, 0.0), Setting(16.12, 12.0)), {}, None, NAMES),
    "some without stiffness": ((*TWELVE[:3], Setting(None, 0.0)), {}, Status.NO_STIFFNESS, NAMES),
}


QUICK = ("wind-off only", "no size", "no stiffness", "some without stiffness")


@cache
def partial_campaign(case):
    settings, options, *_ = PARTIAL[case]
    return campaign(settings, noise=5e-4, rate=250.0, rng=np.random.default_rng(5), **options)


@each_estimator
@pytest.mark.parametrize("case", [case if case in QUICK else slow(case) for case in PARTIAL])
def test_partial_campaigns_give_what_they_can_and_say_the_rest(name, case):
    _, _, status, expected = PARTIAL[case]
    data = partial_campaign(case)
    estimate = checked(identify(data, name), data)
    for quantity in expected:
        truth = getattr(Truth(), quantity)
        assert getattr(estimate, quantity).value == pytest.approx(truth, rel=0.05)
    assert all(run.omega_n is not None for run in estimate.runs)
    if status is None:
        assert estimate.statuses == (Status.OK,)
    else:
        assert status in estimate.statuses
        assert estimate.cn_beta is None or "cn_beta" in expected


@each_estimator
def test_without_size_the_air_is_dimensional(name, of_noisy):
    estimate = identify(noisy_campaign(has_size=False), name)
    sized = of_noisy(name)
    assert estimate.cn_beta is None
    assert estimate.cn_r is None
    for run, with_size in zip(estimate.runs, sized.runs, strict=True):
        for field in ("aerodynamic_stiffness", "aerodynamic_damping"):
            one, other = getattr(run, field), getattr(with_size, field)
            assert (one is None) == (other is None)
            if one is not None:
                assert one.value == pytest.approx(other.value, rel=1e-6)


@cache
def without_a_decay(kind):
    rng = np.random.default_rng(2)
    level = 0.0 if kind == "constant" else 5e-4
    short = campaign(TWELVE[:2], duration=3.0, rate=500.0)
    dead = with_records(short, lambda time, _: 0.1 + level * rng.standard_normal(time.size))
    # One dead run twice would be one record under two springs.
    return replace(dead, runs=dead.runs[:1]) if kind == "constant" else dead


@each_estimator
@pytest.mark.parametrize("kind", [slow("constant"), "noise"])
def test_records_without_a_decay_fail_with_a_remedy(name, kind):
    dead = without_a_decay(kind)
    with pytest.raises(TunnelError, match="no run could be identified; check"):
        identify(dead, name)
    estimate = checked(identify(dead, name, throw=False), dead)
    assert estimate.status is Status.NO_RUN_IDENTIFIED
    assert {run.status for run in estimate.runs} == {Status.NO_OSCILLATION}


@each_estimator
def test_a_dead_run_is_left_out_and_named(name, dead_run):
    estimate = checked(identify(dead_run, name), dead_run)
    assert estimate.status is Status.RUN_LEFT_OUT
    assert estimate.runs[4].status is Status.NO_OSCILLATION
    assert estimate.cn_beta.value == pytest.approx(Truth().cn_beta, rel=0.02)


@each_estimator
def test_wind_without_density_is_bad_input(name, noisy):
    data = replace(noisy, runs=(noisy.runs[0], replace(noisy.runs[1], air_density=None)))
    with pytest.raises(TunnelError, match=r"run r02.*air_density"):
        identify(data, name, throw=False)


@each_estimator
@pytest.mark.parametrize("factor", [0.6, 1.7])
def test_a_wrong_statement_of_the_noise_is_said_and_a_right_one_is_not(name, factor, noisy, of_noisy):
    """0.6 and 1.7: beyond a tolerance of 3.29 times 5 %, with what two runs can say of their noise."""
    assert Status.NOISE_DISAGREES not in of_noisy(name).statuses
    stated = replace(noisy.sensor, noise_std=factor * noisy.sensor.noise_std)
    estimate = identify(replace(noisy, runs=noisy.runs[:2], sensor=stated), name)
    assert Status.NOISE_DISAGREES in estimate.statuses
    assert all(Status.NOISE_DISAGREES in run.statuses for run in estimate.runs)


def test_unknown_names_get_the_closest_one(noisy):
    with pytest.raises(TunnelError, match="did you mean 'output_error'"):
        identify(noisy, "output_eror")


def test_empty_campaign_is_bad_input(noisy):
    with pytest.raises(TunnelError, match="without runs"):
        identify(replace(noisy, runs=()))


def test_every_status_says_what_to_do():
    for status in Status:
        assert status is Status.OK or len(status.value.split(": ", 1)) == 2


@each_estimator
def test_samples_may_be_missing(name, uneven):
    estimate = identify(uneven, name)
    assert "samples missing, up to" in estimate.remarks[0].what
    for quantity in NAMES:
        found, truth = getattr(estimate, quantity), getattr(Truth(), quantity)
        assert abs(found.value - truth) < 6.0 * found.std + accuracy(name) * abs(truth)


@each_estimator
def test_a_rate_has_the_frequency_and_the_damping_of_the_angle(name):
    step = 1e-4
    settings = TWELVE[:2]
    truth = Truth()
    data = campaign(settings)
    rates = []
    for run, setting in zip(data.runs, settings, strict=True):
        time = run.record.time_s + step
        rate = (angle_of(setting, truth, time + step) - angle_of(setting, truth, time - step)) / (2.0 * step)
        rates.append(replace(run, record=Record(time, rate)))
    sensor = replace(data.sensor, quantity="rate")
    found = checked(identify(replace(data, runs=tuple(rates), sensor=sensor), name), data)
    angles = identify(data, name)
    assert "rates" in found.remarks[0].what
    for one, other in zip(found.runs, angles.runs, strict=True):
        allowed = 10.0 * accuracy(name) + 1e-6
        assert one.omega_n.value == pytest.approx(other.omega_n.value, rel=allowed)
        assert one.zeta.value == pytest.approx(other.zeta.value, rel=10.0 * allowed)
        assert one.initial_angle is None
        assert one.sensor_zero is None or one.sensor_zero.unit == "rad/s"
        for window, same in zip(one.windows, other.windows, strict=False):
            assert window.amplitude.value == pytest.approx(same.amplitude.value, rel=0.02)
            assert window.amplitude.unit == "rad"
