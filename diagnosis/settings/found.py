"""Settings of the steps before any fit of effects: runs, noise, gap, and causes detected in the records."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import ONE_IN_1000, setting


@dataclass(frozen=True)
class SelectionSettings:
    """Selection of runs and of their parts."""

    other_mode: float = setting(
        1.5,
        "Minimum ratio of the frequencies with and without wind at which a run counts as another mode.",
        "judgement",
    )
    same_spring: float = setting(
        1.1,
        "Maximum ratio of the frequencies at one wind speed between runs of one spring.",
        "judgement",
        "The stiffnesses then differ by a fifth. Effects of the amplitude change a frequency gradually, and seldom "
        "by this much.",
    )
    long_rest: float = setting(
        0.1,
        "Minimum duration of a rest at the end of a run, as a share of the run, for it to be cut off.",
        "judgement",
        "The angle at which friction stops a body says little about its motion.",
    )
    rest_stds: float = setting(
        5.0,
        "Maximum deviation from the final reading at which the body counts as at rest.",
        "convention",
        unit="std of a block mean",
    )
    blocks_in_cycle: int = setting(
        24,
        "Minimum number of block means per cycle of the motion in the fits of causes.",
        "physics",
        "24 blocks retain 99.4 % of the information at the frequency of the motion.",
        unit="blocks",
    )
    block_loss: float = setting(
        0.01,
        "Maximum share of the gap that wider blocks may average out.",
        "judgement",
        "Causes differ by much larger shares.",
    )
    fast_rate: float = setting(
        0.001,
        "False-alarm rate of the test for a motion too fast for wider blocks.",
        "convention",
        ONE_IN_1000,
    )
    disturbed_rate: float = setting(
        0.001,
        "False-alarm rate of the test for a disturbed run, per campaign.",
        "convention",
        ONE_IN_1000,
    )
    disturbed_fewest: int = setting(
        3,
        "Minimum number of free decays in which a disturbed run is sought.",
        "judgement",
        "With two runs, a disturbance of one cannot be distinguished from a property of all.",
        unit="runs",
    )
    disturbed_share: float = setting(
        0.25,
        "Maximum share of the runs that may be disturbed; at least one run.",
        "judgement",
        "The others show the common behaviour.",
    )
    disturbed_scatter: float = setting(
        0.5,
        "Prior standard deviation between runs of the logarithm of the largest jump in χ².",
        "judgement",
        "Chance alone gives 0.25; causes act more strongly in some runs than in others.",
    )
    disturbed_prior: float = setting(
        4.0,
        "Weight of this prior, in runs.",
        "judgement",
        "A few runs do not determine their scatter.",
        unit="runs",
    )
    disturbed_kept: float = setting(
        6.0,
        "Minimum number of cycles before a disturbance for that part of the run to be used. Otherwise the run is "
        "left out.",
        "judgement",
        "A record needs three cycles, and its damping needs twice as many.",
        unit="cycles",
    )
    odd_share: float = setting(
        0.1,
        "Probability of a run that differs from all others as a whole, before the records are seen.",
        "judgement",
        "In one campaign in ten something happens to a run: a hand at the release, a filter, another gain.",
    )
    odd_holds: float = setting(
        0.5,
        "Minimum share of the gap in each of several odd runs, of the gap of the runs that are left.",
        "convention",
        "Most of it.",
    )
    gross_misfit: float = setting(
        0.01,
        "Minimum residual, as a share of the power of the readings, at which a fit fails to describe the motion.",
        "judgement",
    )


@dataclass(frozen=True)
class NoiseSettings:
    """Noise of the sensor."""

    stated_rate: float = setting(
        0.001,
        "False-alarm rate of the test that the noise contradicts the stated noise.",
        "convention",
        ONE_IN_1000,
    )
    own_rate: float = setting(
        0.001,
        "False-alarm rate of the test that the noise differs between runs.",
        "convention",
        ONE_IN_1000,
    )
    colour_rate: float = setting(
        0.001, "False-alarm rate of the test for coloured noise.", "convention", ONE_IN_1000
    )
    colour_flat: float = setting(
        0.03,
        "Maximum deviation of a band from a flat spectrum that does not count as colour.",
        "judgement",
        "Quantisation causes a deviation of this size.",
    )
    colour_parts: int = setting(
        4,
        "Minimum number of parts of the records for the test for colour.",
        "judgement",
        "Fewer parts may agree by chance.",
        unit="parts",
    )
    colour_amplitudes: float = setting(
        2.0,
        "Minimum ratio of the largest to the smallest motion among these parts, to show that the noise does not "
        "follow the motion.",
        "judgement",
        "The power of noise that follows the motion then differs by a factor of four.",
    )
    colour_band_rate: float = setting(
        0.01,
        "False-alarm rate at which a stationary band is excluded from the spectrum as non-stationary.",
        "convention",
        "One in a hundred.",
    )
    colour_bands: float = setting(
        0.75,
        "Minimum share of stationary bands where only the wind-off runs show the colour.",
        "judgement",
        "Few parts are compared in that case, so non-stationary bands are easily missed.",
    )
    colour_slope_stds: float = setting(
        2.0,
        "Margin by which the slope assumed below the lowest band exceeds the estimated slope.",
        "convention",
        unit="std",
    )
    colour_beyond: float = setting(
        3.5,
        "Multiple of the frequency of the motion above which the spectrum must be coloured where a gap remains.",
        "judgement",
        "The bands below contain the motion.",
    )
    wandering_rate: float = setting(
        0.001, "False-alarm rate of the test for a wandering zero.", "convention", ONE_IN_1000
    )
    repeated_rate: float = setting(
        0.001,
        "False-alarm rate of the test for noise that repeats from run to run.",
        "convention",
        ONE_IN_1000,
    )
    oscillation_rate: float = setting(
        0.001,
        "False-alarm rate of the test for an oscillation excited by the input.",
        "convention",
        ONE_IN_1000,
    )


@dataclass(frozen=True)
class GapSettings:
    """Detection of a gap."""

    detection_rate: float = setting(
        0.001,
        "False-alarm rate of the detection of a gap, all tests combined.",
        "convention",
        ONE_IN_1000,
    )
    noise_tolerance: float = setting(
        0.03,
        "Allowed excess of the noise below 60 Hz over the noise above 60 Hz, as a share.",
        "judgement",
        "Quantisation colours the noise.",
    )
    noise_tails: float = setting(
        1.15,
        "Allowed ratio of the tails of the noise to those of a normal distribution.",
        "judgement",
        "Sensor noise is not exactly normal.",
    )
    noise_above_stated: float = setting(
        1.5,
        "Maximum ratio of the noise variance to the stated variance that does not count as a gap.",
        "judgement",
        "Stated noise is often rounded to one digit.",
    )
    misbehaving_rate: float = setting(
        1e-05,
        "False-alarm rate of the tests for irregular noise, all tests combined.",
        "judgement",
        "A hundredth of the false-alarm rate of a gap, since irregular noise outweighs any cause.",
    )


@dataclass(frozen=True)
class ReadOffSettings:
    """Causes detected in the records before any fit."""

    coarse_step: float = setting(
        1.5,
        "Minimum ratio of the step of the readings to the stated resolution for a coarse sensor.",
        "judgement",
    )
    hum_rate: float = setting(
        0.001, "False-alarm rate of the detection of mains hum.", "convention", ONE_IN_1000
    )
    hum_run_rate: float = setting(
        0.001, "False-alarm rate of the line of the hum in a single run.", "convention"
    )
    hum_runs: float = setting(0.75, "Minimum share of the runs that must show the hum.", "judgement")
    hum_contrast: float = setting(
        4.0,
        "Minimum ratio of the drop of χ² at the line of the hum to the largest drop nearby, all runs combined.",
        "judgement",
        "The spectrum also rises at natural frequencies of the rod and at corner frequencies.",
    )
    hum_steady: float = setting(
        0.25,
        "Minimum ratio of the hum's power in one half of the runs to its power in the other half.",
        "judgement",
        "Hum from an amplifier or a lamp may change by a factor of two. A mode excited at the release decays more.",
    )
    hum_covered: float = setting(
        0.2,
        "Maximum share of the spectrum that is searched for mains lines as plain as that of a hum: the probability "
        "that a line of another source is taken for hum.",
        "judgement",
        "Beside a lower multiple of the mains the line needs no such limit.",
    )
    mains_hz: float = setting(
        0.0,
        "Frequency of the mains as you know it, 50 or 60 Hz; 0: not known. Folded harmonics then count alone.",
        "judgement",
        "Most campaigns do not state it.",
        unit="Hz",
    )
    hum_alike: float = setting(
        0.02,
        "Maximum relative difference in evidence at which two mains frequencies explain the lines equally well.",
        "judgement",
    )
    hum_swell_rate: float = setting(
        1e-05,
        "False-alarm rate of the test for hum that varies in amplitude.",
        "judgement",
        "A hundredth of the false-alarm rate of a hum.",
    )
    lead_rate: float = setting(
        0.001,
        "False-alarm rate of the test for a motion that leads its input.",
        "convention",
        ONE_IN_1000,
    )
