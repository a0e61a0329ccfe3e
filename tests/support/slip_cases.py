"""Everyday slips by name: those that an attack on the program found, and further ones."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import butter, lfilter, lfilter_zi

from tests.support.slip_rig import (
    DENSITY,
    INERTIA,
    NOISE,
    RATE,
    SPEEDS,
    SPRINGS,
    ZERO,
    Condition,
    Slip,
    both,
    clocking,
    exchanged,
    high_passed,
    honest,
    padded,
    reading,
    repeated,
    scaling,
    sensing,
    stating,
    twice,
    wrapped,
)
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.record import Array


@dataclass(frozen=True)
class Case:
    """A slip, and what the examination must say.

    Args:
        given: the campaign without the slip.
        says: words of the remark.
        runs: ids that the remark must name.
        refused: whether the campaign is refused; otherwise it goes on without the fault, or with a question.
    """

    given: Campaign
    slip: Slip
    says: str
    runs: tuple[str, ...]
    refused: bool = True

    @property
    def campaign(self) -> Campaign:
        """The campaign with the slip."""
        return self.slip(self.given)


def _clock(change: float, *springs_and_speeds: tuple[float, float]) -> Campaign:
    """A campaign whose clock drifts in some conditions; in all where none is named."""
    return honest(
        [
            Condition(k, v, clock=change * (not springs_and_speeds or (k, v) in springs_and_speeds))
            for k in SPRINGS
            for v in SPEEDS
        ]
    )


def _speeds(*actual: float) -> Campaign:
    """A campaign whose runs have these wind speeds, two of each spring."""
    springs = np.repeat(SPRINGS, 2).tolist()
    return honest([Condition(spring, speed) for spring, speed in zip(springs, actual, strict=True)])


def _several_speeds() -> Campaign:
    return honest([Condition(k, v) for k in SPRINGS for v in (0.0, 10.0, 15.0, 20.0)])


def _with_noise(std: float) -> Slip:
    rng = np.random.default_rng(17)
    return twice(lambda time, yaw: (time, yaw + rng.normal(0.0, std, yaw.size)))


def _unplugged(yaw: Array) -> Array:
    at, rng = round(0.7 * yaw.size), np.random.default_rng(18)
    return np.concatenate([yaw[:at], ZERO + rng.normal(0.0, NOISE, yaw.size - at)])


def _holding(begin: int, end: int, value: float | None = None) -> Slip:
    """Samples of the first run that keep one value; their first one where None."""

    def change(yaw: Array) -> Array:
        stuck = yaw.copy()
        stuck[begin:end] = yaw[begin] if value is None else value
        return stuck

    return reading(change, "r1")


def _six(off: float = 0.0, **actual: float) -> Campaign:
    """Two springs at 0, 15 and 25 m/s, with the actual speeds of some runs, stated in round numbers."""
    return _stated_round([Condition(k, v) for k in SPRINGS for v in (0.0, 15.0, 25.0)], off, actual)


def _nine(off: float = 0.0, **actual: float) -> Campaign:
    """As `_six`, with a third spring."""
    conditions = [Condition(k, v) for k in (*SPRINGS, 67.98) for v in (0.0, 15.0, 25.0)]
    return _stated_round(conditions, off, actual)


def _two_of_21() -> Campaign:
    """Three springs; two of them are 21 N m/rad in two digits."""
    return honest([Condition(k, v) for k in (20.6, 21.4, 44.84) for v in (0.0, 15.0, 25.0)])


def _stated_round(conditions: list[Condition], off: float, actual: dict[str, float]) -> Campaign:
    moved = [
        replace(one, speed=actual.get(f"r{number}", one.speed or off))
        for number, one in enumerate(conditions, 1)
    ]
    data = honest(moved)
    runs = tuple(
        replace(run, wind_speed=one.speed, air_density=DENSITY if one.speed else None)
        for run, one in zip(data.runs, conditions, strict=True)
    )
    return replace(data, runs=runs)


def _density_along(change: float) -> Slip:
    """A density that is stated to change along the campaign, as it does not."""

    def slip(data: Campaign) -> Campaign:
        last = len(data.runs) - 1
        runs = tuple(
            replace(run, air_density=DENSITY * (1.0 + change * number / last) if run.wind_on else None)
            for number, run in enumerate(data.runs)
        )
        return replace(data, runs=runs)

    return slip


def _springs(*stated: float) -> Slip:
    """The springs stated as others, in their order."""

    def slip(data: Campaign) -> Campaign:
        known = sorted({run.spring_stiffness or 0.0 for run in data.runs})
        meant = dict(zip(known, stated, strict=True))
        runs = tuple(replace(run, spring_stiffness=meant[run.spring_stiffness or 0.0]) for run in data.runs)
        return replace(data, runs=runs)

    return slip


def _low_passed(corner: float, *names: str) -> Slip:
    """Readings behind a Butterworth filter of the logger, Hz."""
    b, a = butter(2, corner, fs=RATE)

    def change(yaw: Array) -> Array:
        return np.asarray(lfilter(b, a, yaw, zi=lfilter_zi(b, a) * yaw[0])[0])

    return reading(change, *names)


def _noisier(std: float, *names: str) -> Slip:
    rng = np.random.default_rng(19)
    return reading(lambda yaw: yaw + rng.normal(0.0, std, yaw.size), *names)


def _missing(value: float, *names: str) -> Slip:
    """Some samples of a value that stands for a missing reading."""

    def change(yaw: Array) -> Array:
        gone = yaw.copy()
        gone[np.random.default_rng(20).choice(yaw.size, 12, replace=False)] = value
        return gone

    return reading(change, *names)


def _nothing(data: Campaign) -> Campaign:
    return data


PLAIN = honest()
"""Four honest runs, the same for all slips."""
SIX, NINE = _six(), _nine()
RELEASED = repeated(2, release=True)
"""Eight honest runs that state their release."""
ALL = ("r1", "r2", "r3", "r4")
ON, OFF = ("r2", "r4"), ("r1", "r3")
WIND = {"wind_speed": 15.0, "air_density": 1.2}

TABLE: dict[str, Case] = {
    "springs in N mm/rad": Case(PLAIN, scaling(spring_stiffness=1e3), "Cn_beta = 495", ON, refused=False),
    "springs in N cm/rad": Case(PLAIN, scaling(spring_stiffness=1e2), "Cn_beta = 49.5", ON, refused=False),
    "springs in N m/deg": Case(
        PLAIN, scaling(spring_stiffness=np.pi / 180.0), "spring_stiffness in N m/deg", OFF, refused=False
    ),
    "time in minutes": Case(PLAIN, clocking(lambda t: t / 60.0), "time_s in minutes", OFF, refused=False),
    "fan off in every run": Case(
        _speeds(0.0, 0.0, 0.0, 0.0), stating(*ON, **WIND), "check whether the fan was on", ON, refused=False
    ),
    "one speed in km/h": Case(PLAIN, stating("r2", wind_speed=54.0), "54 of r2 as 15 m/s (in km/h)", ("r2",)),
    "one speed of the stiff spring in km/h": Case(
        PLAIN, stating("r4", wind_speed=54.0), "54 of r4 as 15 m/s (in km/h)", ("r4",)
    ),
    "1.5 for 15 m/s": Case(PLAIN, stating("r2", wind_speed=1.5), "1.5 of r2 as 15 m/s", ("r2",)),
    "wind labels exchanged": Case(
        PLAIN,
        both(stating(*OFF, **WIND), stating(*ON, wind_speed=0.0)),
        "the runs with the wind on and off are exchanged",
        ALL,
    ),
    "wind labels exchanged of one spring": Case(
        PLAIN,
        exchanged("r1", "r2", "wind_speed", "air_density"),
        "wind_speed of r1 and r2 exchanged",
        ("r1", "r2"),
    ),
    "one sign inverted": Case(PLAIN, reading(lambda y: -y, "r2"), "sign of the sensor is inverted", ("r2",)),
    "one sign inverted, release stated": Case(
        honest(release=True), reading(lambda y: -y, "r2"), "sign of the sensor is inverted", ("r2",)
    ),
    "half of the runs mirrored": Case(
        PLAIN, reading(lambda y: -y, "r1", "r2"), "sign of the sensor is inverted", ("r1", "r2")
    ),
    "one spring's label wrong": Case(
        PLAIN, stating("r2", spring_stiffness=44.84), "44.84 of r2 as 16.12 N m/rad", ("r2",)
    ),
    "last third zeros": Case(
        PLAIN, reading(padded(1.0 / 3.0)), "the reading is constant at 0 rad", ("r1",), refused=False
    ),
    "last third held": Case(
        PLAIN, reading(padded(1.0 / 3.0, None), "r3"), "the reading is constant at", ("r3",), refused=False
    ),
    "repeated with noise of 1e-9": Case(
        PLAIN, _with_noise(1e-9), "so counted once", ("again",), refused=False
    ),
    "repeated and rounded": Case(
        PLAIN, twice(lambda t, y: (t, np.round(y, 4))), "so counted once", ("again",), refused=False
    ),
    "repeated and cut by 50 samples": Case(
        PLAIN, twice(lambda t, y: (t[50:], y[50:])), "so counted once", ("again",), refused=False
    ),
    "repeated times 1.001": Case(
        PLAIN, twice(lambda t, y: (t, 1.001 * y)), "so counted once", ("again",), refused=False
    ),
    "wraps at pi": Case(PLAIN, reading(wrapped()), "jumps by whole turns", ALL, refused=False),
    "clock drifts by 0.5 %": Case(_clock(0.005), _nothing, "the clock of the logger drifts", ALL),
    "AC-coupled": Case(PLAIN, reading(high_passed(1.0, held=False)), "AC-coupled", ALL),
    "AC-coupled, held before": Case(PLAIN, reading(high_passed(1.0, held=True)), "AC-coupled", ALL),
    "resolution of 0.5 rad": Case(
        PLAIN, sensing(resolution=0.5), "resolution = 0.5 rad contradicts", ("r1",), refused=False
    ),
    "release on the other side": Case(
        honest(release=True), stating("r2", release_angle=-0.26), "the other side", ("r2",), refused=False
    ),
    "one run in radians under yaw_deg": Case(
        SIX, reading(np.radians, "r5"), "radians in a column of degrees", ("r5",)
    ),
    "one run low-passed at 6 Hz": Case(SIX, _low_passed(6.0, "r5"), "the logger filtered the run", ("r5",)),
    "a second day's density 18 % too low": Case(
        SIX, scaling("r5", "r6", air_density=0.82), "0.984 of r5, r6 as 1.2 kg/m3", ("r5", "r6")
    ),
    "idle wind in the runs that state none": Case(
        _nine(off=4.0), _nothing, "a wind of 4 m/s in r1, r4, r7", ("r1", "r4", "r7")
    ),
    "all springs one number up": Case(
        SIX, _springs(21.02, 51.88), "16.12 for 21.02, 44.84 for 51.88 N m/rad", ("r1", "r4")
    ),
    "one speed 10 % low": Case(_six(r3=27.5), _nothing, "25 of r3 as 27.5 m/s", ("r3",)),
    "density rises along the campaign": Case(
        SIX, _density_along(0.2), "air_density falling by 17 % from the first run to the last", ("r2", "r6")
    ),
    "one clock 10 % fast": Case(PLAIN, clocking(lambda t: 1.1 * t, "r1"), "time_s of r1 10 % fast", ("r1",)),
    "two springs rounded to one value": Case(
        _two_of_21(),
        _springs(21.0, 21.0, 45.0),
        "two springs under the rounded value 21 N m/rad, the one in r1, r2, r3 3.7 % softer",
        ("r1", "r2", "r3"),
    ),
    "one clock jumps": Case(
        PLAIN, clocking(lambda t: t + 30.0 * (t > 4.0), "r2"), "time_s jumps by 30 s after 4 s", ("r2",)
    ),
    "a value for missing readings": Case(
        PLAIN, _missing(-9.99, "r2"), "12 readings of -9.99 rad, far from all others", ("r2",), refused=False
    ),
}

FURTHER: dict[str, Case] = {
    "one speed in mph": Case(PLAIN, scaling("r4", wind_speed=2.2369), "of r4 as 15 m/s (in mph)", ("r4",)),
    "one speed in knots": Case(PLAIN, scaling("r2", wind_speed=1.9438), "of r2 as 15 m/s (in knots)", ("r2",)),
    "one speed in ft/s": Case(PLAIN, scaling("r2", wind_speed=3.2808), "of r2 as 15 m/s (in ft/s)", ("r2",)),
    "150 for 15 m/s": Case(PLAIN, stating("r4", wind_speed=150.0), "150 of r4 as 15 m/s", ("r4",)),
    "fan off in one run": Case(
        _speeds(0.0, 0.0, 0.0, 15.0), stating("r2", **WIND), "15 of r2 as 0 m/s (with the wind off)", ("r2",)
    ),
    "wind on in a wind-off run": Case(
        _speeds(15.0, 15.0, 0.0, 15.0), stating("r1", wind_speed=0.0), "0 of r1 as 15 m/s", ("r1",)
    ),
    "one spring in N mm/rad": Case(PLAIN, scaling("r3", spring_stiffness=1e3), "of r3 as 44.84", ("r3",)),
    "one spring in N m/deg": Case(
        PLAIN, scaling("r2", spring_stiffness=np.pi / 180.0), "of r2 as 16.12", ("r2",)
    ),
    "one spring's decimal point": Case(PLAIN, scaling("r1", spring_stiffness=0.1), "of r1 as 16.12", ("r1",)),
    "a spring's decimal point in all its runs": Case(
        PLAIN, scaling("r3", "r4", spring_stiffness=0.1), "4.484 of r3, r4 as 44.84", ("r3", "r4")
    ),
    "two of twelve speeds in km/h": Case(
        repeated(), scaling("r4", "r11", wind_speed=3.6), "54 of r4, r11 as 15 m/s (in km/h)", ("r4", "r11")
    ),
    "one setting in km/h": Case(
        _several_speeds(), scaling("r2", "r6", wind_speed=3.6), "36 of r2, r6 as 10 m/s (in km/h)", ("r2", "r6")
    ),
    "one 20 stated as 10": Case(_several_speeds(), stating("r4", wind_speed=10.0), "10 of r4 as 20", ("r4",)),
    "one 15 stated as 20": Case(_several_speeds(), stating("r7", wind_speed=20.0), "20 of r7 as 15", ("r7",)),
    "two speeds exchanged": Case(
        _several_speeds(), exchanged("r2", "r8", "wind_speed"), "of r2 and r8 exchanged", ("r2", "r8")
    ),
    "two files exchanged": Case(
        _several_speeds(),
        exchanged("r2", "r8", "wind_speed", "spring_stiffness"),
        "spring_stiffness and wind_speed of r2 and r8 exchanged",
        ("r2", "r8"),
    ),
    "one density's decimal point": Case(
        _several_speeds(), scaling("r3", air_density=10.0), "air_density = 12 of r3 as 1.2", ("r3",)
    ),
    "one run in minutes": Case(PLAIN, clocking(lambda t: t / 60.0, "r3"), "time_s of r3 in minutes", ("r3",)),
    "one run in milliseconds": Case(
        PLAIN, clocking(lambda t: 1e3 * t, "r3"), "time_s of r3 in milliseconds", ("r3",)
    ),
    "one run at another rate": Case(
        PLAIN, clocking(lambda t: 2.0 * t, "r2"), "of r2 of a run sampled 2 times as fast", ("r2",)
    ),
    "one run in degrees": Case(
        honest([Condition(k, v, release=0.05) for k in SPRINGS for v in SPEEDS]),
        reading(np.degrees, "r3"),
        "degrees",
        ("r3",),
    ),
    "one run backwards": Case(PLAIN, reading(lambda y: y[::-1], "r1"), "grows with the wind off", ("r1",)),
    "one spring's label in all runs": Case(
        PLAIN, stating(spring_stiffness=16.12), "they state equal springs and winds", ALL
    ),
    "no wind in all runs": Case(PLAIN, stating(wind_speed=0.0), "they state equal springs and winds", ALL),
    "AC-coupled at 0.3 s": Case(PLAIN, reading(high_passed(0.3, held=False)), "AC-coupled", ALL),
    "AC-coupled in one run": Case(PLAIN, reading(high_passed(3.0, held=False), "r3"), "AC-coupled", ("r3",)),
    "clock drifts by -0.3 %": Case(_clock(-0.003), _nothing, "the clock of the logger drifts", ALL),
    "clock of one run drifts": Case(_clock(0.003, (44.84, 0.0)), _nothing, "clock of the logger", ("r3",)),
    "last tenth zeros": Case(PLAIN, reading(padded(0.1)), "is constant at 0 rad", ("r2",), refused=False),
    "sensor unplugged": Case(PLAIN, reading(_unplugged, "r3"), "is constant at 0.00", ("r3",), refused=False),
    "reading stuck for a second": Case(
        PLAIN, _holding(2000, 2600), "the reading is constant while", ("r1",), refused=False
    ),
    "zeros in the middle": Case(
        PLAIN, _holding(2000, 2400, 0.0), "the reading is constant while", ("r1",), refused=False
    ),
    "repeated with noise of 1e-4": Case(PLAIN, _with_noise(1e-4), "so counted once", ("again",), refused=False),
    "repeated and mirrored": Case(
        PLAIN, twice(lambda t, y: (t, -y), "r2"), "so counted once", ("again",), refused=False
    ),
    "repeated under another wind": Case(
        PLAIN,
        twice(lambda t, y: (t, np.round(y, 4)), wind_speed=20.0, air_density=1.2),
        "the same record, by its noise",
        ("again",),
    ),
    "repeated and thinned": Case(
        PLAIN, twice(lambda t, y: (t[::2], y[::2])), "so counted once", ("again",), refused=False
    ),
    "its middle repeated": Case(
        PLAIN, twice(lambda t, y: (t[500:4000], y[500:4000]), "r3"), "so counted once", ("again",), refused=False
    ),
    "wraps at a whole turn": Case(
        PLAIN,
        reading(lambda y: y % (2.0 * np.pi), "r4"),
        "jumps by whole turns",
        ("r4",),
        refused=False,
    ),
    "resolution in degrees": Case(PLAIN, sensing(resolution=0.03), "contradicts", ("r1",), refused=False),
    "half of twelve mirrored": Case(
        repeated(), reading(lambda y: -y, "r1", "r2", "r4", "r5", "r7", "r10"), "sign of the sensor", ("r1", "r3")
    ),
    "one of twelve mirrored": Case(repeated(), reading(lambda y: -y, "r8"), "sign of the sensor", ("r8",)),
    "area in cm2": Case(
        PLAIN,
        lambda d: replace(d, rig=replace(d.rig, frontal_area=360.0)),
        "frontal_area in cm2",
        OFF,
        refused=False,
    ),
    "length in cm": Case(
        PLAIN, lambda d: replace(d, rig=replace(d.rig, reference_length=62.5)), "reference_length in cm", OFF,
        refused=False,
    ),
    "springs in kgf m/rad": Case(
        honest(inertia=INERTIA), scaling(spring_stiffness=1.0 / 9.80665), "in kgf m/rad", OFF, refused=False
    ),
    "half of the runs in radians under yaw_deg": Case(
        PLAIN, reading(np.radians, "r3", "r4"), "radians in a column of degrees", ("r3", "r4")
    ),
    "all but one in degrees": Case(
        honest([Condition(k, v, release=0.05) for k in SPRINGS for v in SPEEDS]),
        reading(np.degrees, "r1", "r2", "r4"),
        "radians in a column of degrees",
        ("r3",),
    ),
    "one run low-passed at 15 Hz": Case(SIX, _low_passed(15.0, "r2"), "the logger filtered the run", ("r2",)),
    "one wind-off run low-passed at 30 Hz": Case(
        NINE, _low_passed(30.0, "r4"), "the logger filtered the run", ("r4",)
    ),
    "one run low-passed at 6 Hz and digitised again": Case(
        SIX,
        both(_low_passed(6.0, "r5"), reading(lambda y: np.round(y / 5e-4) * 5e-4, "r5")),
        "the logger filtered the run",
        ("r5",),
        refused=False,
    ),
    "one run of another amplifier range": Case(
        RELEASED, reading(lambda y: 1.3 * y, "r5"), "the sensor had another gain", ("r5",), refused=False
    ),
    "one run of a tenth of the gain": Case(
        RELEASED, reading(lambda y: 0.1 * y, "r2"), "times those of the other runs", ("r2",), refused=False
    ),
    "one run of five times the noise": Case(
        SIX, _noisier(4.9 * NOISE, "r1"), "its noise is 5.", ("r1",), refused=False
    ),
    "one run of ten times the noise": Case(
        SIX, _noisier(10.0 * NOISE, "r4"), "its noise is 1", ("r4",), refused=False
    ),
    "a second day's density 15 % too high": Case(
        NINE, scaling("r8", "r9", air_density=1.15), "1.38 of r8, r9 as 1.2 kg/m3", ("r8", "r9")
    ),
    "the first day's density 15 % too low": Case(
        NINE, scaling("r2", "r3", air_density=0.85), "1.02 of r2, r3 as 1.2 kg/m3", ("r2", "r3")
    ),
    "idle wind of 6 m/s": Case(_nine(off=6.0), _nothing, "a wind of 6 m/s in r1, r4, r7", ("r1", "r4", "r7")),
    "two springs one number down": Case(
        SIX, _springs(6.12, 35.02), "16.12 for 6.12, 44.84 for 35.02 N m/rad", ("r1", "r4")
    ),
    "one speed 10 % high": Case(_six(r5=13.5), _nothing, "15 of r5 as 13.5 m/s", ("r5",)),
    "density falls along the campaign": Case(
        NINE, _density_along(-0.15), "air_density rising by 17 % from the first run to the last", ("r2", "r9")
    ),
    "one clock 10 % slow": Case(PLAIN, clocking(lambda t: 0.9 * t, "r3"), "time_s of r3 10 % slow", ("r3",)),
    "one clock 4 % fast with the wind on": Case(
        NINE, clocking(lambda t: 1.04 * t, "r5"), "time_s of r5 4 % fast", ("r5",)
    ),
    "clock jumps by days": Case(
        PLAIN, clocking(lambda t: t + 86400.0 * (t > 2.0), "r3"), "time_s jumps by 8.64e+04 s", ("r3",)
    ),
}  # fmt: skip
