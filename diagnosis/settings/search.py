"""Settings of the search: which sets of effects are fitted, and how they are weighed."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import BY_CHANCE, ONE_IN_1000, setting


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
        "Time. Of five campaigns with up to 80,000 readings, one was answered sooner that way, and one later.",
        unit="block means",
        decision="0054",
    )
    begun_on: int = setting(
        15_000,
        "Number of readings in these beginnings.",
        "tuned",
        "Time against coverage, on Silverbox and on sealed campaigns.",
        unit="block means",
        decision="0054",
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
        decision="0009",
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
    burst_rate: float = setting(
        0.001, "False-alarm rate of the test for a random moment in bursts.", "convention", ONE_IN_1000
    )
    one_run_rate: float = setting(
        0.001,
        "False-alarm rate of the test that a random moment acts in one run only.",
        "convention",
        ONE_IN_1000,
    )
    phase_rate: float = setting(
        0.001,
        "False-alarm rate of the test that a random moment follows the phase of the motion.",
        "convention",
        ONE_IN_1000,
    )


@dataclass(frozen=True)
class ScatterSettings:
    """Scatter between runs."""

    scatter_rate: float = setting(
        0.001,
        "False-alarm rate of the test for scatter between runs.",
        "convention",
        ONE_IN_1000,
    )
    which_scatters_rate: float = setting(
        0.05,
        "False-alarm rate of the test that a quantity scatters beside others.",
        "convention",
        "The test whether the runs scatter at all has the rate above.",
    )
    outlier_rate: float = setting(
        0.001,
        "False-alarm rate of the test for an outlying run.",
        "convention",
        ONE_IN_1000,
    )
    trend_rate: float = setting(
        0.001,
        "False-alarm rate of the test for a drift over the campaign.",
        "convention",
        ONE_IN_1000,
    )


@dataclass(frozen=True)
class WeighingSettings:
    """Weights of the sets, and the odds against an unknown cause."""

    steepness: float = setting(1.25, "Exponent of the misfit in a channel.", "tuned", decision="0007")
    scatter_exponent: float = setting(
        1.0,
        "Exponent of the evidence for scatter between runs.",
        "convention",
        "A likelihood.",
        decision="0036",
    )
    needless_scatter: float = setting(
        4.0,
        "Maximum drop of −2 ln of that evidence by a superfluous effect that no single run shows.",
        "estimated",
        "With the price of an effect the limit is 10. In 72 campaigns whose only deviation is scatter between "
        "runs, the best of all effects lowered −2 ln of the evidence by more than 10 in two (11.9 and 13.7), by "
        "8.9 and 6.4 in two, and by 3.1 at most in the others: two or three in 100 exceed 10.",
        unit="χ²",
        decision="0036",
    )
    set_price: float = setting(
        3.0,
        "Cost of every effect, in the logarithm of the weight.",
        "tuned",
        "A further effect must reduce the misfit of one channel by a factor of eleven, or of several channels by "
        "this factor in total.",
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
        "A real effect differs from its textbook form by about a tenth. 20 small causes and the published records, "
        "which are not an independent test, do not distinguish 0.05 from 0.3.",
        decision="0007",
    )
    leak: float = setting(
        0.02,
        "Share of the misfit in other channels that is added to the misfit of a channel.",
        "tuned",
        "A squared phase error appears as an amplitude error. The published records are not an independent test.",
        decision="0007",
    )
    needless_chi2: float = setting(
        20.0,
        "Maximum chance drop of χ² in a channel by a superfluous effect.",
        "judgement",
        "Two parameters lower χ² by more than 20 by chance once in 22,000 effects tried: with 25 "
        "effects, in one campaign of 900.",
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
        "Margin of χ² of a channel over its expectation that counts as chance, in the odds against an unknown "
        "cause.",
        "convention",
        unit="std",
    )
    unknown_at: float = setting(
        0.6,
        "Constant of the log odds that a set is the cause.",
        "tuned",
        "Raised after a logistic regression on simulated and measured fits, which are therefore not an independent "
        "test.",
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
