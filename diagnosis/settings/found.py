"""Settings of the steps before any fit of effects: runs, noise, gap, and causes detected in the records."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import ONE_IN_1000, setting


@dataclass(frozen=True)
class SelectionSettings:
    """The runs, and the parts of them, that are compared."""

    other_mode: float = setting(
        1.5,
        "Ratio of the frequencies with and without wind from which a run swings in another mode.",
        "judgement",
    )
    same_spring: float = setting(
        1.1,
        "Ratio of frequencies at one wind speed above which runs have different springs.",
        "judgement",
        "Stiffnesses a fifth apart. Effects of the amplitude change a frequency gradually, and seldom as "
        "much.",
    )
    long_rest: float = setting(
        0.1,
        "Length of a rest at the end of a run, as a share of it, from which it is cut off.",
        "judgement",
        "The angle at which friction stops a body says little about its motion.",
    )
    rest_stds: float = setting(
        5.0,
        "Distance from the end of a run within which the body counts as at rest.",
        "convention",
        unit="std of a block mean",
    )
    blocks_in_cycle: int = setting(
        24,
        "Fewest block means in a cycle of the motion to which causes are fitted.",
        "physics",
        "They keep all but 0.6 % of the information at the frequency of the motion.",
        unit="blocks",
    )
    block_loss: float = setting(
        0.01,
        "Share of the gap that wider blocks may hide.",
        "judgement",
        "Causes differ by much larger shares.",
    )
    fast_rate: float = setting(
        0.001,
        "Rate at which noise alone counts as a motion that is too fast for wider blocks.",
        "convention",
        ONE_IN_1000,
    )
    disturbed_rate: float = setting(
        0.001,
        "Rate of campaigns without a disturbance in which a run is called disturbed.",
        "convention",
        ONE_IN_1000,
    )
    disturbed_fewest: int = setting(
        3,
        "Fewest free decays among which a disturbed one is sought.",
        "judgement",
        "A feature of one of two runs may as well be one of all.",
        unit="runs",
    )
    disturbed_share: float = setting(
        0.25,
        "Share of the runs that may be disturbed, at least one.",
        "judgement",
        "The others show the common behaviour.",
    )
    disturbed_scatter: float = setting(
        0.5,
        "Expected standard deviation between runs of the logarithm of the greatest jump in χ².",
        "judgement",
        "By chance alone it is 0.25; causes act more in some runs than in others.",
    )
    disturbed_prior: float = setting(
        4.0,
        "Weight of this expectation, as a number of runs.",
        "judgement",
        "Few runs do not determine their scatter.",
        unit="runs",
    )
    disturbed_kept: float = setting(
        6.0,
        "Cycles before a disturbance from which that part of a run is used; with fewer the run is left out.",
        "judgement",
        "A record needs three cycles, and its damping twice as many.",
        unit="cycles",
    )
    gross_misfit: float = setting(
        0.01,
        "Residual, as a share of the readings' power, from which a fit misses the motion itself.",
        "judgement",
    )


@dataclass(frozen=True)
class NoiseSettings:
    """How the noise of the sensor is found."""

    stated_rate: float = setting(
        0.001,
        "Rate at which correctly stated noise is said to contradict the statement.",
        "convention",
        ONE_IN_1000,
    )
    own_rate: float = setting(
        0.001,
        "Rate at which runs of equal noise are said to differ in noise.",
        "convention",
        ONE_IN_1000,
    )
    colour_rate: float = setting(
        0.001, "Rate at which white noise is said to be coloured.", "convention", ONE_IN_1000
    )
    colour_flat: float = setting(
        0.03,
        "Departure of a band from a flat spectrum that does not count as colour.",
        "judgement",
        "Quantisation colours the noise as much.",
    )
    colour_parts: int = setting(
        4,
        "Fewest parts of the records in which a colour is sought.",
        "judgement",
        "Fewer agree by chance.",
        unit="parts",
    )
    colour_amplitudes: float = setting(
        2.0,
        "Ratio of the greatest to the smallest motion among the parts, from which the noise is known not "
        "to follow it.",
        "judgement",
        "The power of noise that follows the motion then differs by a factor of four.",
    )
    colour_band_rate: float = setting(
        0.01,
        "Rate at which a steady band of the noise is excluded from its spectrum as unsteady.",
        "convention",
        "One in a hundred.",
    )
    colour_bands: float = setting(
        0.75,
        "Share of the bands that must be steady where the colour shows in still air alone.",
        "judgement",
        "Few parts are compared there, so that an unsteady band is easily overlooked.",
    )
    colour_slope_stds: float = setting(
        2.0,
        "Excess of the slope assumed below the lowest band over the one found.",
        "convention",
        unit="std",
    )
    colour_beyond: float = setting(
        3.5,
        "Multiple of the motion's frequency beyond which the spectrum must be coloured where a gap remains.",
        "judgement",
        "The bands below belong to the motion.",
    )
    wandering_rate: float = setting(
        0.001, "Rate at which stationary noise is said to be a wandering zero.", "convention", ONE_IN_1000
    )
    repeated_rate: float = setting(
        0.001, "Rate at which noise is said to repeat from run to run.", "convention", ONE_IN_1000
    )
    oscillation_rate: float = setting(
        0.001,
        "Rate at which noise is said to be an oscillation that the input excites.",
        "convention",
        ONE_IN_1000,
    )


@dataclass(frozen=True)
class GapSettings:
    """Whether there is a gap."""

    detection_rate: float = setting(
        0.001,
        "Rate at which a campaign without a gap is said to have one, all tests together.",
        "convention",
        ONE_IN_1000,
    )
    noise_tolerance: float = setting(
        0.03,
        "Share by which the noise below 60 Hz may exceed the noise measured above it.",
        "judgement",
        "Quantisation colours the noise.",
    )
    noise_tails: float = setting(
        1.15,
        "Factor by which tails heavier than those of white noise are accepted.",
        "judgement",
        "Sensor noise is not quite normal.",
    )
    noise_above_stated: float = setting(
        1.5,
        "Ratio of variances up to which noise above the stated level is not part of the gap.",
        "judgement",
        "Stated noise is often rounded to one digit.",
    )
    misbehaving_rate: float = setting(
        1e-05,
        "Rate at which the noise itself is said to misbehave, all tests together.",
        "judgement",
        "A hundredth of the rate of a gap: it outweighs any cause.",
    )


@dataclass(frozen=True)
class ReadOffSettings:
    """Causes detected in the records before any effect is fitted."""

    coarse_step: float = setting(
        1.5,
        "Ratio of the step of the readings to the stated resolution from which it counts as coarser.",
        "judgement",
    )
    hum_rate: float = setting(
        0.001, "Rate at which records without a hum are said to have one.", "convention", ONE_IN_1000
    )
    hum_run_rate: float = setting(
        0.001, "Rate at which a run without the hum's line is said to show it.", "convention"
    )
    hum_runs: float = setting(0.75, "Share of the runs that must show a hum.", "judgement")
    hum_contrast: float = setting(
        4.0,
        "Drop of χ² at the hum's line over the largest beside it, all runs together.",
        "judgement",
        "Rods and corners also raise the spectrum.",
    )
    hum_steady: float = setting(
        0.25,
        "Least ratio of a hum's power in one half of the runs to that in the other half.",
        "judgement",
        "Hum from an amplifier or a lamp may change by a factor of two; a mode excited at the release "
        "loses more.",
    )
    hum_alike: float = setting(
        0.02,
        "Difference of evidence, as a share, up to which two frequencies of the mains explain the lines "
        "alike.",
        "judgement",
    )
    hum_swell_rate: float = setting(
        1e-05,
        "Rate at which a steady hum is said to swell.",
        "judgement",
        "A hundredth of the rate of a hum.",
    )
    lead_rate: float = setting(
        0.001,
        "Rate at which motion without a lead over its input is said to have one.",
        "convention",
        ONE_IN_1000,
    )
