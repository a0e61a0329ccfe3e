"""A random moment of the surroundings: told from that of the stream by the runs with the wind off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from diagnosis.findings.averaged_coefficients import coefficients, possible_answers
from diagnosis.likelihood.least_squares import Fit
from diagnosis.search.hypothesis import Hypothesis
from diagnosis.search.investigate import investigate
from diagnosis.search.process_noise import is_of_reading, likeliest, random_moments, with_response
from diagnosis.search.random_moments import obeys_a_law, weigh_random_moments
from diagnosis.search.random_spectra import (
    LONGEST_BANDWIDTH,
    STREAM,
    SURROUNDINGS,
    FloorPart,
    MomentSource,
    SpectrumPart,
)
from diagnosis.search.scatter import differing
from diagnosis.search.steady_noise import is_a_line, is_slow, is_steady_noise
from diagnosis.settings import Settings
from tests.marks import slow
from tests.reference.linear_rig import response
from tests.support.gap_campaigns import (
    CN_BETA,
    CN_R,
    CONDITIONS,
    DAMPING,
    FOUR,
    INERTIA,
    INTERVAL,
    campaign,
    nominal,
    whole_runs,
)
from tests.support.scattered_runs import SCATTERED
from tests.unit.diagnosis.search.test_process_noise import moment_of
from tunnel_sim.effects import ALL_EFFECTS, Effect, effect_class, effect_from
from tunnel_sim.vocabulary.campaign import Campaign, Repeatability, RigProperties, Run, SensorProperties
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

AREA, LENGTH = 0.036, 0.625
AMBIENT, BUFFETING, VORTICES = (
    effect_class(name) for name in ("ambient_vibration", "buffeting", "vortex_shedding")
)
ALL_RANDOM = (BUFFETING, VORTICES, AMBIENT)
STILL = tuple((spring, 0.0) for spring in (16.12, 44.84) for _ in range(2))
ONE_WIND = tuple((spring, 20.0) for spring in (16.12, 44.84) for _ in range(3))
BANDWIDTH = 4.0  # Hz


def shaken(
    data: Campaign,
    *,
    moment: float = 0.0,
    coefficient: float = 0.0,
    centre: float = 0.0,
    floor: float = 0.0,
    seed: int = 5,
) -> Campaign:
    """Every run under a random moment of first order about a centre, in N m or in proportion to the pressure.

    With a damping ratio of a floor, the moment is in proportion to the acceleration of a floor that resonates at
    the centre under a white force, and its resonance has that size.

    The nominal model is linear, so that the response is added, at eight steps a sample.
    """
    rng, runs = np.random.default_rng(seed), []
    step = INTERVAL / 8
    for run in data.runs:
        time = np.arange(8 * run.record.yaw_rad.size) * step
        speed = run.wind_speed
        pressure = 0.5 * 1.2 * speed**2 * AREA * LENGTH
        stiffness = (run.spring_stiffness or 0.0) - pressure * CN_BETA
        damping = DAMPING - (pressure * LENGTH / speed * CN_R if speed else 0.0)
        std = moment + coefficient * pressure
        bandwidth = 0.2 * BANDWIDTH if centre else BANDWIDTH
        pole = np.exp(2.0 * np.pi * (1j * centre - bandwidth) * step)
        white = rng.standard_normal(time.size) + 1j * rng.standard_normal(time.size)
        given = std * np.real(lfilter([np.sqrt(1.0 - abs(pole) ** 2)], [1.0, -pole], white))
        if floor:  # poles of the floor's motion, and its acceleration from the positions around a sample
            pole = np.exp(2.0 * np.pi * centre * step * (-floor + 1j * np.sqrt(1.0 - floor**2)))
            motion = lfilter([1.0], np.real(np.poly([pole, np.conj(pole)])), white.real)
            quiet = (2.0 * np.pi * centre) ** 2 * motion
            given = std * np.diff(motion, 2, prepend=[0.0, 0.0]) / step**2 / np.std(quiet)
        angle = response(given, step, INERTIA, damping, stiffness)[::8]
        runs.append(replace(run, record=Record(run.record.time_s, run.record.yaw_rad + angle)))
    return replace(data, runs=tuple(runs))


def of(conditions: Sequence[tuple[float, float]], *effects: Effect) -> Campaign:
    """A campaign of these runs; the helper's nominal model has wind, so that such a run is made and left out."""
    data = campaign(*effects, conditions=(*conditions, (16.12, 15.0)))
    return replace(data, runs=data.runs[: len(conditions)])


def answers(data: Campaign, kinds: Sequence[type[Effect]] = ALL_RANDOM) -> list[Hypothesis]:
    return weigh_random_moments(whole_runs(nominal(data), kinds), [])


@pytest.fixture(scope="module")
def ambient() -> Fit:
    """The nominal fit of runs with the wind off and on, all under a moment of the surroundings."""
    return nominal(shaken(campaign(conditions=FOUR), moment=0.02))


@pytest.fixture(scope="module")
def ambient_in_still_air() -> Fit:
    return nominal(shaken(of(STILL), moment=0.02))


def test_a_moment_that_acts_with_the_wind_off_as_well_is_ambient_vibration(ambient: Fit) -> None:
    (answer,) = weigh_random_moments(whole_runs(ambient, ALL_RANDOM), [])
    assert answer.names == ("ambient_vibration",)
    assert moment_of(answer).left.share < 0.1
    (part,) = moment_of(answer).process.spectrum
    assert part.intensity == pytest.approx(0.02, rel=0.3)
    # at the rig only the level of the spectrum around resonance is seen well
    assert part.intensity**2 / part.bandwidth == pytest.approx(0.02**2 / BANDWIDTH, rel=0.3)
    assert len(moment_of(answer).process.runs) == len(FOUR)


def test_a_floor_that_resonates_is_ambient_vibration() -> None:
    """Its spectrum rises with the fourth power below the resonance, and is level above it."""
    base = nominal(shaken(of(STILL), moment=0.05, centre=5.0, floor=0.05))
    by_form = {
        type(one.spectrum[0]): one for one in random_moments(base, SURROUNDINGS) if len(one.spectrum) == 1
    }
    floor, about = by_form[FloorPart], by_form[SpectrumPart]
    (part,) = floor.spectrum
    assert part.centre == pytest.approx(5.0, rel=0.02)
    assert part.bandwidth == pytest.approx(0.05 * 5.0, rel=0.35)  # about a hundred correlation times
    assert part.intensity == pytest.approx(0.05, rel=0.2)
    assert is_steady_noise(floor, Settings().moment)
    assert floor.cost < about.cost - 100.0


def test_the_size_of_a_floors_moment_is_its_power_within_the_rigs_reach() -> None:
    """Truth: the spectrum of the acceleration of a resonance under a white force, summed by frequency."""
    part = FloorPart(0.05, 0.25, 5.0, source=SURROUNDINGS)
    _, _, (white,) = part.dynamics(np.ones(1), np.zeros(1))
    step = 1e-3
    frequency = np.arange(step, LONGEST_BANDWIDTH, step)
    place = frequency / part.centre
    gain = place**4 / ((1.0 - place**2) ** 2 + (2.0 * part.bandwidth / part.centre * place) ** 2)
    power = 2.0 * white[2, 2] * float(np.sum(gain)) * step
    assert part.intensity**2 + part.tail**2 == pytest.approx(power, rel=0.1)
    assert part.tail > 0.1 * part.intensity


@pytest.mark.slow
def test_stated_differences_between_runs_do_not_pull_the_coefficients() -> None:
    """In the sensor's noise the motion moves narrow deviations by many widths, and the coefficients with them."""
    conditions, kinds = (*CONDITIONS, *CONDITIONS), (*ALL_RANDOM, *map(effect_class, SCATTERED))
    data = shaken(of(conditions), moment=0.02, seed=20)
    study = investigate(replace(data, repeatability=Repeatability(2e-4, 2e-5, 4e-4)), kinds)
    assert study.causes == ("ambient_vibration",)
    found = coefficients(possible_answers(study, kinds), study.campaign)["cn_beta"]
    assert found.std is not None
    assert found.std < 0.004
    assert abs(found.value - CN_BETA) < 3.0 * found.std


@pytest.mark.slow
def test_a_moment_that_grows_with_the_pressure_is_buffeting() -> None:
    (answer,) = answers(shaken(campaign(conditions=FOUR), coefficient=0.01))
    assert answer.names == ("buffeting",)
    assert moment_of(answer).process.runs == ("r2", "r4")


@pytest.mark.parametrize(
    ("source", "random", "zero", "spring"),
    [
        (SURROUNDINGS, 0.0, 2e-3, 0.0),
        (STREAM, 0.0, 0.0, 5e-4),
        (SURROUNDINGS, 1.0, 0.0, 0.0),
        slow(STREAM, 1.0, 0.0, 0.0),
        slow(SURROUNDINGS, 0.0, 0.0, 5e-4),
        slow(STREAM, 0.0, 2e-3, 0.0),
    ],
)
def test_zeros_and_springs_that_differ_are_no_random_moment(
    source: MomentSource, random: float, zero: float, spring: float
) -> None:
    """Each run swings steadily about its zero; under a random moment its amplitude and its phase wander."""
    sizes = {"moment": 0.02 * random} if source is SURROUNDINGS else {"coefficient": 0.01 * random}
    data, rng = shaken(campaign(conditions=FOUR), **sizes), np.random.default_rng(2)
    runs = [
        replace(
            run,
            record=Record(run.record.time_s, run.record.yaw_rad + zero * rng.standard_normal()),
            spring_stiffness=(run.spring_stiffness or 0.0) * (1.0 + spring * rng.standard_normal()),
        )
        for run in data.runs
    ]
    fitted = nominal(replace(data, runs=tuple(runs)))
    process = likeliest(random_moments(fitted, source), fitted.settings.moment)
    assert process is not None
    assert is_slow(fitted, process, source, ALL_EFFECTS) == (random == 0.0)


def test_a_spring_of_its_own_is_no_random_moment_and_hides_none() -> None:
    """Still runs, of which one has a softer spring, without and with a moment of the surroundings."""
    data = campaign(conditions=FOUR)
    still = [place for place, run in enumerate(data.runs) if run.wind_speed == 0.0]
    for moment in (0.0, 0.02):
        moved = shaken(data, moment=moment)
        run = moved.runs[still[0]]
        time = run.record.time_s
        odd = replace(run, record=Record(time, CubicSpline(time, run.record.yaw_rad)(0.997 * time)))
        fitted = nominal(replace(moved, runs=(odd, *moved.runs[1:])))
        assert still[0] == 0
        apart = differing(fitted, still, tuple(map(effect_class, SCATTERED)))
        assert apart is not None
        assert likeliest(random_moments(fitted, SURROUNDINGS), fitted.settings.moment) is not None
        shown = likeliest(random_moments(apart, SURROUNDINGS), fitted.settings.moment)
        assert (shown is not None) == (moment > 0.0)


@pytest.mark.slow
def test_both_at_once_are_one_spectrum_with_a_part_of_each() -> None:
    (answer,) = answers(shaken(shaken(campaign(conditions=FOUR), moment=0.02), coefficient=0.02, seed=6))
    assert answer.names == ("ambient_vibration", "buffeting")


@pytest.mark.slow
def test_runs_in_one_wind_cannot_tell_them_apart() -> None:
    found = answers(shaken(of(ONE_WIND), moment=0.03))
    assert {answer.names for answer in found} == {("ambient_vibration",), ("buffeting",)}
    first, second = (moment_of(answer).left.share for answer in found)
    assert first == pytest.approx(second, abs=1e-3)


@pytest.mark.slow
def test_of_two_kinds_that_the_runs_cannot_tell_apart_the_one_that_may_be_named_is() -> None:
    data = shaken(of(ONE_WIND), moment=0.03)
    for kind in (AMBIENT, BUFFETING):
        (answer,) = answers(data, (kind,))
        assert moment_of(answer).kinds == (kind,)


@pytest.mark.slow
def test_without_wind_it_is_the_surroundings() -> None:
    (answer,) = answers(shaken(of(STILL), moment=0.02))
    assert answer.names == ("ambient_vibration",)


@pytest.mark.parametrize("conditions", [FOUR, STILL])
def test_without_a_random_moment_none_is_named(conditions: Sequence[tuple[float, float]]) -> None:
    assert answers(of(conditions)) == []


@pytest.mark.parametrize("conditions", [slow(CONDITIONS), slow(STILL), STILL[:1]])
def test_a_missing_law_is_no_random_moment(conditions: Sequence[tuple[float, float]]) -> None:
    """The law is not offered as a cause; of one run it is predicted from stretch to stretch."""
    for missing in (
        effect_from("quadratic_damping", {"coefficient": 0.003}),
        effect_from("cubic_stiffness", {"coefficient": -0.2}),
    ):
        base = nominal(of(conditions, missing))
        assert obeys_a_law(base, SURROUNDINGS)
        assert weigh_random_moments(whole_runs(base, ALL_RANDOM), []) == []


FIRST_ORDER = {bandwidth: np.exp(-2.0 * np.pi * bandwidth * INTERVAL) for bandwidth in (0.05, 5.0)}
RINGING = (
    2.0 * 0.98 * np.cos(2.0 * np.pi * 2.2 * INTERVAL)
)  # 2.2 Hz: 1.14 times the motion of the softer spring


@pytest.mark.parametrize(
    "recursion",
    [slow([1.0, -FIRST_ORDER[0.05]]), [1.0, -FIRST_ORDER[5.0]], [1.0, -RINGING, 0.98**2]],
    ids=["wandering zero", "coloured", "ringing sensor"],
)
def test_noise_of_the_reading_is_no_random_moment(recursion: list[float]) -> None:
    """Truth: noise added to the readings."""
    rng, runs, data = np.random.default_rng(8), [], of(STILL)
    for run in data.runs:
        noise = lfilter([1.0], recursion, rng.standard_normal(run.record.yaw_rad.size + 2000))[2000:]
        reading = run.record.yaw_rad + 2e-3 * noise / np.std(noise)
        runs.append(replace(run, record=Record(run.record.time_s, reading)))
    base = nominal(replace(data, runs=tuple(runs)))
    process = min(random_moments(base, SURROUNDINGS), key=lambda one: one.cost)
    assert process.drop > 100.0  # it would take it up
    assert is_of_reading(base, process)
    assert weigh_random_moments(whole_runs(base, ALL_RANDOM), []) == []


def test_a_moment_is_not_of_the_reading_and_does_not_fade(ambient_in_still_air: Fit) -> None:
    process = min(random_moments(ambient_in_still_air, SURROUNDINGS), key=lambda one: one.cost)
    assert not is_of_reading(ambient_in_still_air, process)
    assert process.intensities == pytest.approx(np.ones(3), abs=0.3)
    assert is_steady_noise(process, Settings().moment)


def test_a_motion_that_the_model_misses_fades_and_is_no_random_moment() -> None:
    """Truth: a second mode of a tenth of a degree that dies with the motion, in every run with its own phase."""
    rng, runs, data = np.random.default_rng(10), [], of(STILL)
    for run in data.runs:
        time = run.record.time_s
        mode = 2e-3 * np.exp(-0.3 * time) * np.cos(2.0 * np.pi * (2.1 * time + rng.uniform()))
        runs.append(replace(run, record=Record(time, run.record.yaw_rad + mode)))
    base = nominal(replace(data, runs=tuple(runs)))
    process = min(random_moments(base, SURROUNDINGS), key=lambda one: one.cost)
    assert process.drop > 100.0
    assert process.intensities[0] > 2.0 * process.intensities[-1]
    assert not is_steady_noise(process, Settings().moment)


@pytest.mark.parametrize("decay", [0.0, 0.3])
def test_a_line_is_no_random_moment(decay: float) -> None:
    """Truth: a platform that vibrates at one frequency, in every run with its own phase; or a mode that decays."""
    rng, runs, data = np.random.default_rng(9), [], of(STILL)
    for run in data.runs:
        time, size = run.record.time_s, 1e-3 if decay == 0.0 else rng.uniform(1e-3, 4e-3)
        line = size * np.exp(-decay * time) * np.sin(2.0 * np.pi * (7.0 * time + rng.uniform()))
        runs.append(replace(run, record=Record(run.record.time_s, run.record.yaw_rad + line)))
    base = nominal(replace(data, runs=tuple(runs)))
    process = min(random_moments(base, SURROUNDINGS), key=lambda one: one.cost)
    assert process.spectrum[0].centre == pytest.approx(7.0, rel=0.02)  # it would take it up
    assert is_a_line(base, process)
    assert weigh_random_moments(whole_runs(base, ALL_RANDOM), []) == []


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1.25, 1.1])
def test_a_mode_of_the_mount_is_no_random_moment(ratio: float) -> None:
    """Truth: two modes coupled by a hundredth, in closed form; it was buffeting, and ambient vibration at 1.1."""
    rng, time, runs = np.random.default_rng(3), 0.01 * np.arange(1200), []
    for place, (spring, speed) in enumerate((k, v) for v in (0.0, 15.0, 22.0) for k in (16.0, 30.0)):
        pressure = 0.5 * 1.2 * speed**2 * AREA * LENGTH
        stiffness = np.diag([(spring - pressure * CN_BETA) / 0.1, ratio**2 * 160.0])
        lever = LENGTH / speed if speed else 0.0
        damping = np.diag([(0.02 - pressure * lever * -0.1) / 0.1, 0.008 * ratio * np.sqrt(160.0)])
        mass = np.linalg.inv([[1.0, 0.01], [0.01, 1.0]])
        system = np.block([[np.zeros((2, 2)), np.eye(2)], [-mass @ stiffness, -mass @ damping]])
        values, vectors = np.linalg.eig(system)
        parts = np.linalg.solve(vectors, [0.3, 0.0, 0.0, 0.0]) * vectors[0]
        angle = np.real(np.exp(np.outer(time, values)) @ parts) + rng.normal(0.0, 3e-4, time.size)
        density = 1.2 if speed else None
        runs.append(Run(f"r{place}", Record(time, angle), speed, spring, density))
    rig = RigProperties(frontal_area=AREA, reference_length=LENGTH)
    data = Campaign("mount", rig, SensorProperties(100.0), tuple(runs))
    study = investigate(data, (BUFFETING, AMBIENT, effect_class("spring_miscalibration")), rivals=())
    assert study.gap.test.detected
    assert study.moment is None


@pytest.mark.slow
def test_a_random_moment_about_a_frequency_is_no_steady_line() -> None:
    (answer,) = answers(shaken(of(STILL), moment=0.02, centre=7.0))
    assert answer.names == ("ambient_vibration",)


def test_a_moment_of_all_runs_is_not_called_buffeting_where_the_surroundings_are_excluded(
    ambient: Fit,
) -> None:
    (answer,) = weigh_random_moments(whole_runs(ambient, ALL_RANDOM[:2]), [])
    assert moment_of(answer).left.share > 0.2  # the runs with the wind off keep their gap


def test_the_moment_of_the_surroundings_has_the_scale_of_the_rig(ambient: Fit) -> None:
    """A moment of a thousandth in a rig with a thousandth of the moments, and the same in a larger unit."""
    base, data = ambient, ambient.problem.data
    for moment in (1e-3, 1e3):
        point = replace(base.point, common=base.point.common * np.array([moment, moment, 1.0, 1.0, 1.0]))
        runs = tuple(
            replace(run, spring_stiffness=(run.spring_stiffness or 0.0) * moment) for run in data.runs
        )
        area = data.frontal_area * moment
        scaled = replace(base.problem, data=replace(data.with_runs(runs), frontal_area=area))
        linear = base.linear * np.array([moment, moment, moment])
        fitted = replace(base, problem=scaled, point=point)
        fitted.__dict__["linear"] = linear
        ours, theirs = (random_moments(one, SURROUNDINGS)[0] for one in (fitted, base))
        assert ours.drop == pytest.approx(theirs.drop, rel=1e-3)
        assert ours.spectrum[0].intensity == pytest.approx(moment * theirs.spectrum[0].intensity, rel=0.05)


def test_a_moment_of_the_stream_is_not_sought_without_wind(ambient_in_still_air: Fit) -> None:
    assert random_moments(ambient_in_still_air, STREAM) == []
    assert with_response(ambient_in_still_air, (SpectrumPart(0.01, BANDWIDTH),)) is None
    assert random_moments(ambient_in_still_air, SURROUNDINGS)
