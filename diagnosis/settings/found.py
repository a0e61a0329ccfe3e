"""Settings of the steps before any fit of effects: runs, noise, gap, and causes detected in the records."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import ONE_IN_1000, setting


@dataclass(frozen=True)
class SelectionSettings:
    """Selection of runs and of their parts."""

    blocks_in_cycle: int = setting(
        24,
        "Minimum number of block means per cycle of the motion in the fits of causes.",
        "physics",
        "24 blocks retain 99.4 % of the information at the frequency of the motion.",
        unit="blocks",
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
    odd_share: float = setting(
        0.1,
        "Probability of a run that differs from all others as a whole, before the records are seen.",
        "judgement",
        "In one campaign in ten something happens to a run: a hand at the release, a filter, another gain.",
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
    colour_band_rate: float = setting(
        0.01,
        "False-alarm rate at which a stationary band is excluded from the spectrum as non-stationary.",
        "convention",
        "One in a hundred.",
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
    misbehaving_rate: float = setting(
        1e-05,
        "False-alarm rate of the tests for irregular noise, all tests combined.",
        "judgement",
        "A hundredth of the false-alarm rate of a gap, since irregular noise outweighs any cause.",
    )


@dataclass(frozen=True)
class ReadOffSettings:
    """Causes detected in the records before any fit."""

    hum_rate: float = setting(
        0.001, "False-alarm rate of the detection of mains hum.", "convention", ONE_IN_1000
    )
    hum_run_rate: float = setting(
        0.001, "False-alarm rate of the line of the hum in a single run.", "convention"
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
