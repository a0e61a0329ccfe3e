"""The settings of every stage of a diagnosis."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import BY_CHANCE, ONE_IN_1000, rate, setting


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
    fast_rate: float = rate("the test for a motion too fast for wider blocks")
    disturbed_rate: float = rate("the test for a disturbed run, per campaign")
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

    stated_rate: float = rate("the test that the noise contradicts the stated noise")
    own_rate: float = rate("the test that the noise differs between runs")
    colour_rate: float = rate("the test for coloured noise")
    colour_band_rate: float = setting(
        0.01,
        "False-alarm rate at which a stationary band is excluded from the spectrum as non-stationary.",
        "convention",
        "One in a hundred.",
    )
    wandering_rate: float = rate("the test for a wandering zero")
    repeated_rate: float = rate("the test for noise that repeats from run to run")
    oscillation_rate: float = rate("the test for an oscillation excited by the release or the input")


@dataclass(frozen=True)
class GapSettings:
    """Detection of a gap."""

    detection_rate: float = rate("the detection of a gap, all tests combined")
    misbehaving_rate: float = rate(
        "the tests for irregular noise, all tests combined",
        1e-05,
        why="A hundredth of the false-alarm rate of a gap, since irregular noise outweighs any cause.",
        origin="judgement",
    )


@dataclass(frozen=True)
class ReadOffSettings:
    """Causes detected in the records before any fit."""

    hum_rate: float = rate("the detection of mains hum")
    hum_run_rate: float = rate("the line of the hum in a single run", why="")
    hum_covered: float = setting(
        0.2,
        "Maximum share of the spectrum that is searched for mains lines as plain as a hum's: the "
        "probability that a line of another source is taken for hum.",
        "judgement",
        "Beside a lower multiple of the mains the line needs no such limit.",
    )
    mains_hz: float = setting(
        0.0,
        "Frequency of the mains as you know it, 50 or 60 Hz; 0: not known. Folded harmonics then count "
        "alone.",
        "judgement",
        "Most campaigns do not state it.",
        unit="Hz",
    )
    hum_swell_rate: float = rate(
        "the test for hum that varies in amplitude",
        1e-05,
        why="A hundredth of the false-alarm rate of a hum.",
        origin="judgement",
    )
    lead_rate: float = rate("the test for a motion that leads its input")


@dataclass(frozen=True)
class SearchSettings:
    """Search for effects and sets of effects."""

    grown_from: int = setting(
        2,
        "Number of sets of each size to which another effect is added.",
        "judgement",
        "Time against coverage.",
        unit="sets",
    )
    grown_on: int = setting(
        45_000,
        "Maximum number of readings on which sets are grown; longer campaigns omit some stretches.",
        "judgement",
        "Time. Twelve runs of 10 s have fewer.",
        unit="block means",
    )
    long_input: int = setting(
        75_000,
        "Number of readings above which sets of causes of driven runs are found in their beginnings.",
        "tuned",
        "Time. Of five campaigns with up to 80,000 readings, one was answered sooner that way, and one "
        "later.",
        unit="block means",
        decision="0007",
    )
    begun_on: int = setting(
        15_000,
        "Number of readings in these beginnings.",
        "tuned",
        "Time against coverage, on Silverbox and on sealed campaigns.",
        unit="block means",
        decision="0007",
    )


@dataclass(frozen=True)
class RandomMomentSettings:
    """Random moments and effects beside them."""

    acts_from: float = setting(
        20.0,
        "Minimum drop of −2 ln L for a random moment.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
        decision="0046",
    )
    part_price: float = setting(
        20.0,
        "Minimum drop of −2 ln L for a centre frequency or a second part of the spectrum.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
    )
    effect_price: float = setting(
        20.0,
        "Minimum drop of −2 ln L for an effect beside a random moment.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
    )
    burst_rate: float = rate("the test for a random moment in bursts")
    one_run_rate: float = rate("the test that a random moment acts in one run only")
    phase_rate: float = rate("the test that a random moment follows the phase of the motion")


@dataclass(frozen=True)
class ScatterSettings:
    """Scatter between runs."""

    scatter_rate: float = rate("the test for scatter between runs")
    which_scatters_rate: float = rate(
        "the test that a quantity scatters beside others",
        0.05,
        why="The test whether the runs scatter at all has the rate above.",
    )
    outlier_rate: float = rate("the test for an outlying run")
    trend_rate: float = rate("the test for a pattern of the differences between runs")


@dataclass(frozen=True)
class WeighingSettings:
    """Weights of the sets, and the odds against an unknown cause."""

    steepness: float = setting(1.25, "Exponent of the misfit in a channel.", "tuned", decision="0007")
    scatter_exponent: float = setting(
        1.0,
        "Exponent of the evidence for scatter between runs.",
        "convention",
        "A likelihood.",
        decision="0007",
    )
    needless_scatter: float = setting(
        4.0,
        "Maximum drop of −2 ln of that evidence by a superfluous effect that no single run shows.",
        "estimated",
        "With the price of an effect the limit is 10. In 72 campaigns whose only deviation is scatter "
        "between runs, the best of all effects lowered −2 ln of the evidence by more than 10 in two (11.9 "
        "and 13.7), by 8.9 and 6.4 in two, and by 3.1 at most in the others: two or three in 100 exceed 10.",
        unit="χ²",
        decision="0007",
    )
    set_price: float = setting(
        3.0,
        "Cost of every effect, in the logarithm of the weight.",
        "tuned",
        "A further effect must reduce the misfit of one channel by a factor of eleven, or of several "
        "channels by this factor in total.",
        decision="0007",
    )
    form_price: float = setting(
        1.0,
        "Cost of every freed form and instant, in the logarithm of the weight.",
        "tuned",
        "The cost of an instant is a judgement.",
        decision="0007",
    )
    model_error: float = setting(
        0.001,
        "Maximum misfit of a channel, as a share of the motion, that needs no cause.",
        "judgement",
        "Sensors and springs are linear and repeatable to about one part in a thousand.",
        decision="0007",
    )
    form_error: float = setting(
        0.1,
        "Maximum misfit of a channel, as a share of the gap in that channel, that needs no cause.",
        "judgement",
        "A real effect differs from its textbook form by about a tenth. 20 small causes and the published "
        "records, which are not an independent test, do not distinguish 0.05 from 0.3.",
        decision="0007",
    )
    leak: float = setting(
        0.02,
        "Share of the misfit in other channels that is added to the misfit of a channel.",
        "tuned",
        "A squared phase error appears as an amplitude error. The published records are not an independent "
        "test.",
        decision="0007",
    )
    needless_chi2: float = setting(
        20.0,
        "Maximum chance drop of χ² in a channel by a superfluous effect.",
        "judgement",
        "Two parameters lower χ² by more than 20 by chance once in 22,000 effects tried: with 25 effects, "
        "in one campaign of 900.",
        unit="χ²",
        decision="0007",
    )
    own_number_gain: float = setting(
        10.0,
        "Maximum chance drop of χ² by an instant or phase of a single run.",
        "judgement",
        "It is one number, the best of many tried.",
        unit="χ²",
    )
    chance_stds: float = setting(
        2.0,
        "Margin of χ² of a channel over its expectation that counts as chance, in the odds against an "
        "unknown cause.",
        "convention",
        unit="std",
    )
    unknown_at: float = setting(
        0.6,
        "Constant of the log odds that a set is the cause.",
        "tuned",
        "Raised after a logistic regression on simulated and measured fits, which are therefore not an "
        "independent test.",
        decision="0007",
    )
    unknown_gap: float = setting(
        0.21,
        "Increase of these log odds with the significance of the gap.",
        "estimated",
        "Logistic regression on fits with and without the true effects, simulated and measured.",
        decision="0007",
    )
    unknown_left: float = setting(
        2.0,
        "Decrease of these log odds with the logarithm of the residual over the explained share.",
        "estimated",
        "Logistic regression on fits with and without the true effects, simulated and measured.",
        decision="0007",
    )
    least_closed: float = setting(
        0.02,
        "Share added to the explained share in these odds.",
        "judgement",
        "The logarithm stays finite.",
        decision="0007",
    )
    unknown_from: float = setting(
        0.5,
        "Minimum probability for `unknown` to be the answer.",
        "convention",
        "`unknown` is then more probable than all sets together.",
    )
    even_share: float = setting(
        0.03,
        "Share of the probability that is spread evenly over all answers.",
        "tuned",
        "The rate of wrong answers with a dominant weight, for causes outside the fits and the compared "
        "explanations.",
        decision="0007",
    )


@dataclass(frozen=True)
class WhereSettings:
    """Location of the gap."""

    run_rate: float = rate("the test that a run shows the gap, all runs combined", 0.01)
    still_rate: float = rate("the test that the wind-off runs show a gap", 0.01)
    band_rate: float = rate("the test that a band shows the gap, all bands combined", 0.01)
    line_rate: float = rate("a line in a run, all runs and frequencies combined", 0.01)
    interval_share: float = setting(0.8, "Share of the excess in a stated interval.", "judgement")


@dataclass(frozen=True)
class AnswerSettings:
    """Decision and uncertainties."""

    decided_from: float = setting(
        0.5,
        "Minimum probability of a decided answer.",
        "convention",
        "More probable than all others together.",
    )
    credible_from: float = setting(
        0.9, "Total probability of the stated set of likely answers.", "convention"
    )
    rivals_from: float = setting(
        0.05, "Minimum probability of a rival answer to be stated and to plan a run for.", "tuned"
    )
    coefficient_interval: float = setting(0.95, "Probability of the interval of a coefficient.", "convention")
    small_cause_price: float = setting(
        20.0, "Cost of every small cause, in χ².", "judgement", BY_CHANCE, unit="χ²", decision="0028"
    )
    small_form_std: float = setting(
        0.5,
        "Standard deviation of a small cause's change of a coefficient, as a share of the change, since its "
        "form is unknown.",
        "judgement",
        "Chosen after a blind test with too narrow intervals; tested on campaigns drawn afterwards.",
        decision="0028",
    )
    freed_form_std: float = setting(
        0.5,
        "Standard deviation for freed forms, as a share of the change by freeing them.",
        "judgement",
        "Another family of forms may change a coefficient by this much.",
        decision="0028",
    )
    unknown_std: float = setting(
        0.5,
        "Standard deviation for an unknown cause, as a share of the change by the answer.",
        "judgement",
        decision="0028",
    )
    remains_rate: float = rate("the test for a residual gap, and for a further effect")


@dataclass(frozen=True)
class RemainderSettings:
    """Explainable part of the residual."""

    steady_line_rate: float = rate("a steady line, all frequencies combined", 0.01)
    term_rate: float = rate("a term of a formula, all terms combined")


@dataclass(frozen=True)
class WordsSettings:
    """Sentences and tables."""

    hold_rate: float = setting(
        0.001,
        "Rate at which the correct hold of an input is not mentioned beside a delay of half a sample.",
        "convention",
        ONE_IN_1000,
    )
    zeros_rate: float = rate("differences between the zeros of runs")


@dataclass(frozen=True)
class WorkSettings:
    """Division of the work; the answers are bit-identical with any of these settings."""

    threads: int = setting(
        2,
        "Number of threads that integrate runs.",
        "judgement",
        "The work between two predictions waits for all threads.",
        unit="threads",
    )
