"""Settings of the search: which sets of effects are fitted, and how they are weighed."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import BY_CHANCE, ONE_IN_1000, setting


@dataclass(frozen=True)
class SearchSettings:
    """Search for effects and sets of effects."""

    always_fitted: int = setting(
        7,
        "Number of effects that are fitted in any case, ranked by linear theory.",
        "judgement",
        "Linear theory ranks effects well, but cannot decide.",
        unit="effects",
    )
    predicted_share: float = setting(
        0.01, "Minimum predicted drop of χ², as a share of χ², for further effects to be fitted.", "judgement"
    )
    least_drop: float = setting(
        20.0,
        "Minimum predicted drop of χ² for an effect to be fitted beside others.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
    )
    reach_from: float = setting(
        0.5,
        "Unexplained share of the gap, for the best set of a size, above which the limit of larger sets is "
        "computed.",
        "judgement",
        "The largest of a few causes explains about half of a gap.",
    )
    out_of_reach: float = setting(
        0.2,
        "Unexplained share of the gap, with all effects together, above which no larger sets are grown.",
        "estimated",
        "In 77 simulated campaigns with one to four known causes the share is 0.15 at most; it exceeds 0.05 in "
        "two. In six of 14 campaigns with a cause outside the vocabulary it exceeds 0.4. These campaigns are not "
        "an independent test.",
    )
    nearly_explained: float = setting(
        0.2,
        "Maximum unexplained share of the gap within runs for the forms of a set beside scatter to be freed.",
        "judgement",
        "The effect of another form of a cause differs from that of the textbook form by less than 45 %. In two "
        "simulated campaigns of three and four causes, free forms did not improve sets with an unexplained share "
        "of 0.26 to 0.81.",
    )
    grown_beside: float = setting(
        0.2,
        "Maximum unexplained share of the gap within runs for a set beside scatter to be extended, where no set "
        "explains the runs.",
        "judgement",
        "In two unblinded campaigns of two and three causes, the first cause left 0.02 and 0.09. Time against "
        "coverage.",
        decision="0036",
    )
    likely_beside_scatter: int = setting(
        6,
        "Number of effects that are fitted in any case where scatter between runs explains their deviations.",
        "judgement",
        "Linear theory underestimates effects hidden by deviations of the runs. Time against coverage.",
        unit="effects",
    )
    beside_scatter: int = setting(
        4,
        "Number of sets, found for runs that repeat, that are compared with scatter between runs added.",
        "judgement",
        "Time against coverage.",
        unit="sets",
        decision="0036",
    )
    grown_from: int = setting(
        2,
        "Number of sets of each size to which another effect is added.",
        "judgement",
        "Time against coverage.",
        unit="sets",
    )
    grown_by: int = setting(
        4, "Number of effects that are added to a set.", "judgement", "Time against coverage.", unit="effects"
    )
    fitted_longer: int = setting(
        4,
        "Number of sets of each size that are found on short stretches and fitted to long ones.",
        "judgement",
        "Time against coverage.",
        unit="sets",
    )
    growth_loss: float = setting(
        2.8,
        "Maximum loss in the logarithm of the weight by an added effect for the set to be extended further.",
        "judgement",
        "A superfluous effect costs more. One of two equal causes explains only half.",
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
    compared_from: float = setting(
        0.01,
        "Minimum probability of a set of the beginnings of driven runs for comparison in whole runs.",
        "judgement",
        "Time against coverage.",
        decision="0054",
    )
    most_causes: int = setting(
        5,
        "Maximum number of named causes.",
        "convention",
        "One to four causes of the vocabulary, and a small one.",
        unit="effects",
    )
    same_change: float = setting(
        0.02,
        "Maximum difference between the changes of two equivalent sets, as a share of the power.",
        "judgement",
    )
    form_open: float = setting(
        0.02,
        "Minimum share of the excess unexplained by a textbook form for its forms to be freed.",
        "judgement",
        decision="0008",
    )
    form_needed: float = setting(
        0.2,
        "Minimum rise of χ² without a freed form, as a share of the excess, for the form to be kept.",
        "tuned",
        decision="0008",
    )
    freed_hypotheses: int = setting(
        3,
        "Number of sets of one effect whose forms are freed.",
        "judgement",
        "Time against coverage.",
        unit="sets",
        decision="0008",
    )
    rival_forms: float = setting(
        0.05, "Minimum probability of a rival set for its forms to be freed.", "judgement"
    )
    outside_from: float = setting(
        0.05,
        "Minimum probability of a set for comparison with explanations outside the vocabulary.",
        "judgement",
    )
    two_springs_of: int = setting(
        3,
        "Minimum number of springs for two of them to be called miscalibrated.",
        "physics",
        "With fewer springs, one effect of the vocabulary fits any frequencies.",
        unit="springs",
    )
    choices_from: float = setting(
        0.05, "Minimum probability of an answer for alternative springs to be sought.", "judgement"
    )
    moment_noise_from: float = setting(
        0.05,
        "Minimum probability of a set for its residual random moment to be modelled as noise.",
        "judgement",
    )
    moment_left: float = setting(
        0.25,
        "Maximum power of the residual random moment of a set, as a share of the missing moment, for a body "
        "without a spring.",
        "judgement",
        "Half its size: a cause explains most of the gap. The EMPS axis (0.115) is not an independent test.",
    )
    moment_chance: float = setting(
        1.0,
        "Maximum relative standard deviation of the best set's residual for sets to be compared by the moment.",
        "convention",
        "The standard deviation then equals the residual.",
    )
    resolved_stds: float = setting(
        2.0,
        "Minimum distance of an effect from zero, fitted to one half of the records, for that half to confirm it.",
        "convention",
        unit="std",
    )
    survives_size: float = setting(
        0.5,
        "Minimum size of an effect without any one run that the others could replace, as a share of its size.",
        "convention",
        "The other runs then confirm more than half of it.",
    )
    survives_stds: float = setting(
        3.0,
        "Minimum standard deviations by which the other runs must miss that size; and minimum size of an effect "
        "for them to show it.",
        "convention",
        "One of 700 runs misses it by chance.",
        unit="std",
    )
    survives_excess: float = setting(
        1.0,
        "Maximum excess of a fit without a run, as a ratio to the noise variance, for it to contradict the size of "
        "an effect.",
        "judgement",
        "A residual as large as the noise. A fit that leaves more is not a model of the other runs.",
    )
    gravity_cancels: float = setting(
        0.8,
        "Maximum share of an unstated spring that gravity may cancel.",
        "judgement",
        "Beyond this share the two imitate a nonlinear spring. Silverbox is not an independent test.",
        decision="0029",
    )
    plausible_runs: float = setting(
        0.5, "Minimum share of the runs in which an effect must agree with its definition.", "convention"
    )
    mode_runs: float = setting(
        0.5,
        "Minimum share of the runs in which a second mode must be distinct from the motion.",
        "convention",
    )
    turned_as_well: float = setting(
        1.01,
        "Maximum ratio of χ² at which a fit with the angle turned by half a turn explains the readings equally "
        "well.",
        "judgement",
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
    part_stds: float = setting(
        2.0, "Margin of that drop over the minimum, in its scatter between runs.", "convention", unit="std"
    )
    alike_within: float = setting(
        20.0,
        "Difference of −2 ln L below which two kinds of random moment explain the residuals equally well.",
        "judgement",
        "The minimum drop for a random moment: real spectra are not first-order, and smaller differences reflect "
        "the shape of the spectrum.",
        unit="χ²",
        decision="0046",
    )
    effect_price: float = setting(
        20.0,
        "Minimum drop of −2 ln L for an effect beside a random moment.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
    )
    evident_from: float = setting(
        20.0,
        "Minimum drop of χ² for a further effect beside a random moment to be evident.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
    )
    further_effects: int = setting(
        2,
        "Maximum number of effects added to make the innovations white.",
        "judgement",
        "Time against coverage.",
        unit="effects",
    )
    white_innovations: float = setting(
        10.0,
        "Maximum deviation of the power of the innovations from white noise, by band and by quarter of a record.",
        "judgement",
        "Chance alone gives less than 3.5. Real spectra are not first-order. With the true sets of unblinded "
        "campaigns it is at most 9.0.",
        unit="std",
        decision="0009",
    )
    burst_rate: float = setting(
        0.001, "False-alarm rate of the test for a random moment in bursts.", "convention", ONE_IN_1000
    )
    burst_power: float = setting(
        1.5,
        "Maximum power of short innovations of a steady moment, relative to chance.",
        "judgement",
        "Real turbulence is not exactly stationary.",
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
    law_share: float = setting(
        0.5,
        "Minimum share of the residual, on held-out runs, that a law with the wind must explain to replace a "
        "random moment.",
        "convention",
        "More than half.",
    )
    no_noise_share: float = setting(
        0.9,
        "Share of the residual explained by one law, on held-out runs, above which no random moment is sought.",
        "judgement",
        "At most a tenth of the residual then differs from run to run.",
    )
    explains_most: float = setting(
        1.5,
        "Maximum drop of −2 ln L by a random moment, as a multiple of the χ² beyond noise that the nominal model "
        "leaves in its runs.",
        "judgement",
        "The release of a run absorbs part of a random motion, and the nominal model all that it can; a half is "
        "allowed for both.",
    )
    explains_alone: float = setting(
        3.0,
        "The same for a random moment without effects beside it.",
        "judgement",
        "The nominal model and the releases may absorb two thirds of a random motion of few cycles. In two "
        "campaigns where a moment acts alone the drop is 1.54 and 1.61; no campaign shows where the limit fails.",
    )
    explains_stds: float = setting(
        4.0, "Margin of χ² of noise over that maximum.", "convention", "One campaign in 30,000.", unit="std"
    )
    steady_line_share: float = setting(
        0.9,
        "Share of the residual explained by a line with a phase per run, above which the moment is a line.",
        "judgement",
        "A line explains nine tenths of a random moment whose half-width is a twentieth of one over the duration.",
        decision="0046",
    )
    law_stds: float = setting(2.0, "Margin over that share, in its scatter.", "convention", unit="std")


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
    shown_stds: float = setting(
        4.0,
        "Minimum size of an effect for single runs to show it, without a comparison of runs.",
        "convention",
        "One effect in 16,000 reaches this size by chance.",
        unit="std",
    )
    limit_told: float = setting(
        0.5,
        "Maximum ratio of the upper limit of a scatter that is not detected to its limit before any run, for the "
        "runs to say something about it.",
        "judgement",
        "Above it the limit is the prior's.",
    )
    widths_settled: float = setting(
        1.0,
        "Drop of −2 ln L above which a fit is repeated with new widths of the scatter.",
        "convention",
        "A smaller change is insignificant.",
        unit="χ²",
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
    needless_spring: float = setting(
        0.05,
        "Maximum stiffness of an unstated spring, as a share of its stiffness with gravity, at which the rig has "
        "no spring.",
        "judgement",
        "The set then counts two parameters less: a spring would have to soften by chance exactly as much as "
        "gravity does.",
        decision="0018",
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
    choice_kept: float = setting(
        0.05, "Minimum probability of an alternative spring to be stated.", "judgement"
    )
    hum_left: float = setting(
        0.02, "Maximum residual share of a removed hum that needs no cause.", "judgement"
    )
    noise_explains: float = setting(
        1.0,
        "Maximum gap that irregular noise explains completely.",
        "judgement",
        "The noise variance itself.",
        unit="noise variances of a sample",
    )
    shares_chance: float = setting(
        1.0,
        "Standard deviation of the explained share of the gap above which the shares of all sets are chance.",
        "convention",
        "As large as the gap itself.",
    )
    noise_excused: float = setting(
        0.8,
        "Explained share of a gap this small above which irregular noise is not its cause.",
        "judgement",
        "Effects with few parameters explain little of any noise.",
        decision="0007",
    )
