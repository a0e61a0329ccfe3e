"""Settings of the search: which sets of effects are fitted, and how they are weighed."""

from __future__ import annotations

from dataclasses import dataclass

from diagnosis.settings.origin import BY_CHANCE, ONE_IN_1000, setting


@dataclass(frozen=True)
class SearchSettings:
    """Which effects and sets of effects are fitted."""

    always_fitted: int = setting(
        7,
        "Effects fitted whatever linear theory predicts.",
        "judgement",
        "Linear theory ranks well but cannot decide.",
        unit="effects",
    )
    predicted_share: float = setting(
        0.01, "Predicted drop, as a share of χ², from which further effects are fitted.", "judgement"
    )
    least_drop: float = setting(
        20.0,
        "Predicted drop of χ² from which an effect is fitted beside others.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
    )
    reach_from: float = setting(
        0.5,
        "Unexplained share of the gap, under all sets of a size, from which the limit of larger sets is "
        "computed.",
        "judgement",
        "The largest of a few causes explains about half of a gap.",
    )
    out_of_reach: float = setting(
        0.2,
        "Unexplained share of the gap, under all effects together, from which no larger sets are grown.",
        "estimated",
        "In 77 simulated campaigns with one to four known causes it is 0.15 at most, and above 0.05 in "
        "two. In six of 14 with a cause outside the vocabulary it is above 0.4. These campaigns do not "
        "test it.",
    )
    nearly_explained: float = setting(
        0.2,
        "Share of the gap within runs that a set beside scatter may leave for its forms to be freed.",
        "judgement",
        "Another form of a cause differs from the textbook's by less than 45 % of what the cause does. In two "
        "simulated campaigns of three and four causes, sets that left 0.26 to 0.81 left as much with free forms.",
    )
    grown_beside: float = setting(
        0.2,
        "Share of the gap within runs that a set beside scatter may leave for larger sets to be grown "
        "from it, where none explains the runs.",
        "judgement",
        "In two opened campaigns of two and three causes, the first one left 0.02 and 0.09. Time against coverage.",
        decision="0036",
    )
    likely_beside_scatter: int = setting(
        6,
        "Effects fitted whatever linear theory predicts, where chance differences between the runs "
        "explain them.",
        "judgement",
        "Linear theory underestimates effects hidden by deviations of the runs. Time against coverage.",
        unit="effects",
    )
    beside_scatter: int = setting(
        4,
        "Sets, found in runs that repeat, that are compared beside chance differences between the runs.",
        "judgement",
        "Time against coverage.",
        unit="sets",
        decision="0036",
    )
    grown_from: int = setting(
        2,
        "Sets of each size to which another effect is added.",
        "judgement",
        "Time against coverage.",
        unit="sets",
    )
    grown_by: int = setting(
        4, "Effects added to a set.", "judgement", "Time against coverage.", unit="effects"
    )
    fitted_longer: int = setting(
        4,
        "Sets of each size, found on short stretches, that are fitted to long ones.",
        "judgement",
        "Time against coverage.",
        unit="sets",
    )
    growth_loss: float = setting(
        2.8,
        "Logarithm of the weight that a set may lose for an added effect and still grow.",
        "judgement",
        "A superfluous effect costs more; one of two equal causes explains only half.",
    )
    grown_on: int = setting(
        45_000,
        "Readings of stretches on which sets are grown; in longer campaigns some stretches are left out.",
        "judgement",
        "Time. Twelve runs of 10 s are below it.",
        unit="block means",
    )
    most_causes: int = setting(
        5,
        "Greatest number of named causes.",
        "convention",
        "The vocabulary's one to four, and a small one beside them.",
        unit="effects",
    )
    same_change: float = setting(
        0.02,
        "Difference between the changes of two sets, as a share of the power, up to which they are the same.",
        "judgement",
    )
    form_open: float = setting(
        0.02,
        "Share of the excess left by a textbook form from which forms are freed.",
        "judgement",
        decision="0008",
    )
    form_needed: float = setting(
        0.2,
        "Rise of χ² without a freed form, as a share of the excess, from which the form is kept.",
        "tuned",
        decision="0008",
    )
    freed_hypotheses: int = setting(
        3,
        "Sets of one effect whose forms are freed.",
        "judgement",
        "Time against coverage.",
        unit="sets",
        decision="0008",
    )
    rival_forms: float = setting(
        0.05, "Probability from which the forms of a rival set are freed.", "judgement"
    )
    outside_from: float = setting(
        0.05,
        "Probability of a set from which rivals from outside the vocabulary are tried in its place.",
        "judgement",
    )
    two_springs_of: int = setting(
        3,
        "Fewest springs with which two of them may be said to be off.",
        "physics",
        "With fewer, one effect of the vocabulary fits any frequencies.",
        unit="springs",
    )
    choices_from: float = setting(
        0.05, "Probability of an answer from which its choices of a spring are sought.", "judgement"
    )
    moment_noise_from: float = setting(
        0.05,
        "Probability of a set from which its residual random moment is tried as noise.",
        "judgement",
    )
    moment_left: float = setting(
        0.25,
        "Greatest power of the residual random moment of a set, as a share of the missing moment, for a "
        "body without a spring.",
        "judgement",
        "Half its size: a cause is the greater part of the gap. The EMPS axis (0.115) does not test it.",
    )
    moment_chance: float = setting(
        1.0,
        "Standard deviation of the best set's residual, as a share of it, below which sets are weighed "
        "by the moment.",
        "convention",
        "As large as the residual itself.",
    )
    resolved_stds: float = setting(
        2.0,
        "Distance of an effect from zero in half of the records from which that half confirms it.",
        "convention",
        unit="std",
    )
    gravity_cancels: float = setting(
        0.8,
        "Greatest share of an unstated spring that gravity may cancel.",
        "judgement",
        "Beyond it the two imitate a nonlinear spring. Silverbox does not test it.",
        decision="0029",
    )
    plausible_runs: float = setting(
        0.5, "Least share of the runs in which an effect must still be what its name means.", "convention"
    )
    mode_runs: float = setting(
        0.5, "Least share of the runs in which a second mode must be distinct from the motion.", "convention"
    )
    turned_as_well: float = setting(
        1.01, "Ratio of χ² up to which a fit half a turn away explains the readings as well.", "judgement"
    )


@dataclass(frozen=True)
class RandomMomentSettings:
    """Random moments, and the effects beside them."""

    acts_from: float = setting(
        20.0,
        "Drop of −2 ln L from which a random moment acts.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
        decision="0009",
    )
    part_price: float = setting(
        20.0,
        "Least drop of −2 ln L by a centre or a second part of its spectrum.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
    )
    part_stds: float = setting(
        2.0, "Scatter between the runs by which that drop must exceed its price.", "convention", unit="std"
    )
    alike_within: float = setting(
        20.0,
        "Difference of −2 ln L below which two kinds of random moment explain the residuals alike.",
        "judgement",
        "The drop from which one acts: a real spectrum is not first-order, and a smaller difference is "
        "its form.",
        unit="χ²",
        decision="0046",
    )
    effect_price: float = setting(
        20.0, "Least drop of −2 ln L by an effect beside it.", "judgement", BY_CHANCE, unit="χ²"
    )
    evident_from: float = setting(
        20.0,
        "Drop of χ² from which a further effect is evident beside it.",
        "judgement",
        BY_CHANCE,
        unit="χ²",
    )
    further_effects: int = setting(
        2,
        "Greatest number of effects added to make the innovations white.",
        "judgement",
        "Time against coverage.",
        unit="effects",
    )
    white_innovations: float = setting(
        10.0,
        "Largest departure of the innovations' power from white, by band and by quarter of a record.",
        "judgement",
        "By chance it is below 3.5; a real spectrum is not first-order. Beside the true sets of "
        "opened campaigns it is at most 9.0.",
        unit="std",
        decision="0009",
    )
    burst_rate: float = setting(
        0.001, "Rate at which a steady random moment is said to come in bursts.", "convention", ONE_IN_1000
    )
    burst_power: float = setting(
        1.5,
        "Greatest power of short innovations of a steady moment, over that by chance.",
        "judgement",
        "Real turbulence is not quite steady.",
    )
    one_run_rate: float = setting(
        0.001, "Rate at which a moment of all runs is said to be in one run only.", "convention", ONE_IN_1000
    )
    phase_rate: float = setting(
        0.001,
        "Rate at which a random moment is said to follow the phase of the motion.",
        "convention",
        ONE_IN_1000,
    )
    law_share: float = setting(
        0.5,
        "Share of the residual that a law of the wind must explain on held-out runs to replace it.",
        "convention",
        "The greater part, by the word.",
    )
    no_noise_share: float = setting(
        0.9,
        "Share of the residual explained by one law on held-out runs from which no random moment is sought.",
        "judgement",
        "At most a tenth of the residual then differs from run to run.",
    )
    steady_line_share: float = setting(
        0.9,
        "Share of the residual explained by a line, with a phase per run, from which the moment is a line.",
        "judgement",
        "A random moment of half-width b leaves a tenth to such a line where b is a twentieth over the "
        "duration.",
        decision="0046",
    )
    law_stds: float = setting(2.0, "Scatter by which that share must be exceeded.", "convention", unit="std")


@dataclass(frozen=True)
class ScatterSettings:
    """Chance differences between runs."""

    scatter_rate: float = setting(
        0.001,
        "Rate at which runs that repeat are said to differ by chance.",
        "convention",
        ONE_IN_1000,
    )
    which_scatters_rate: float = setting(
        0.05,
        "Rate at which a quantity is said to scatter beside others that do.",
        "convention",
        "Whether the runs differ at all is tested at the rate above.",
    )
    outlier_rate: float = setting(
        0.001,
        "Rate at which a run is said to deviate far beyond the others.",
        "convention",
        ONE_IN_1000,
    )
    trend_rate: float = setting(
        0.001,
        "Rate at which runs that differ by chance are said to drift over the campaign.",
        "convention",
        ONE_IN_1000,
    )
    shown_stds: float = setting(
        4.0,
        "Size of an effect from which runs show it without their comparison.",
        "convention",
        "By chance one effect in 16,000 is as large.",
        unit="std",
    )
    widths_settled: float = setting(
        1.0,
        "Drop of −2 ln L from which a fit is repeated with other widths.",
        "convention",
        "A smaller change is insignificant.",
        unit="χ²",
    )


@dataclass(frozen=True)
class WeighingSettings:
    """How sets of effects are weighed, and when none is named."""

    steepness: float = setting(1.25, "Exponent of the misfit in a channel.", "tuned", decision="0007")
    scatter_exponent: float = setting(
        1.0,
        "Exponent of the evidence of chance differences between the runs.",
        "convention",
        "A likelihood.",
        decision="0036",
    )
    needless_scatter: float = setting(
        4.0,
        "Greatest drop of −2 ln of that evidence by a superfluous effect that no run shows by itself.",
        "estimated",
        "With the price of an effect it is 10. In 72 campaigns whose runs differ by chance alone, the "
        "best of all effects lowered it by more than 10 in two (11.9 and 13.7), by 8.9 and 6.4 in two, "
        "and by 3.1 at most in the rest: two or three in 100 exceed 10.",
        unit="χ²",
        decision="0036",
    )
    set_price: float = setting(
        3.0,
        "Logarithm of the weight that every effect costs.",
        "tuned",
        "A further effect must reduce one channel to less than an eleventh, or as much of several together.",
        decision="0007",
    )
    form_price: float = setting(
        1.0,
        "Logarithm of the weight that every freed form and instant costs.",
        "tuned",
        "The equal price of an instant is a judgement.",
        decision="0007",
    )
    model_error: float = setting(
        0.001,
        "Greatest misfit of a channel that needs no cause, as a share of the motion.",
        "judgement",
        "Sensors and springs are linear and repeat to about one part in a thousand.",
        decision="0007",
    )
    form_error: float = setting(
        0.1,
        "Misfit of a channel that needs no cause, as a share of the gap in that channel.",
        "judgement",
        "A real effect departs from its textbook form by about a tenth. 20 small causes and the open "
        "records, which do not test it, do not separate 0.05 from 0.3.",
        decision="0007",
    )
    leak: float = setting(
        0.02,
        "Share of the misfit in other channels that counts in a channel.",
        "tuned",
        "A phase error, squared, is an amplitude error. The open records do not test it.",
        decision="0007",
    )
    needless_chi2: float = setting(
        20.0,
        "Chance gain of χ² in a channel by a superfluous effect.",
        "judgement",
        "By chance alone two numbers lower χ² by more than 20 once in 22,000 effects tried: with 25 "
        "effects, in one campaign of 900.",
        unit="χ²",
        decision="0007",
    )
    own_number_gain: float = setting(
        10.0,
        "Chance gain of χ² by an instant or phase of a single run.",
        "judgement",
        "It is one number, the best of many tried.",
        unit="χ²",
    )
    needless_spring: float = setting(
        0.05,
        "Stiffness of an unstated spring, as a share of that with gravity, below which the rig "
        "needs no spring.",
        "judgement",
        "The set then counts two parameters less: a spring would have to soften by chance, and as much "
        "as gravity does.",
        decision="0018",
    )
    chance_stds: float = setting(
        2.0, "χ² of a channel that is chance, in the odds against an unknown cause.", "convention", unit="std"
    )
    unknown_at: float = setting(
        0.6,
        "Constant of the log odds that a set is the cause.",
        "tuned",
        "Raised from a logistic regression on simulated and measured fits, which do not test it.",
        decision="0007",
    )
    unknown_gap: float = setting(
        0.21,
        "Increase of these log odds with the significance of the gap.",
        "estimated",
        "A logistic regression on fits with and without the true effects, simulated and measured.",
        decision="0007",
    )
    unknown_left: float = setting(
        2.0,
        "Decrease of these log odds with the logarithm of the residual over the explained share.",
        "estimated",
        "A logistic regression on fits with and without the true effects, simulated and measured.",
        decision="0007",
    )
    least_closed: float = setting(
        0.02,
        "Share added to the explained share in these odds.",
        "judgement",
        "It keeps the logarithm finite.",
        decision="0007",
    )
    unknown_from: float = setting(
        0.5,
        "Probability from which an unknown cause is the answer.",
        "convention",
        "More probable than all sets together.",
    )
    even_share: float = setting(
        0.03,
        "Share of the probability that is spread evenly over all answers.",
        "tuned",
        "The rate of wrong answers of overwhelming weight, from causes that neither fits nor rivals include.",
        decision="0007",
    )
    choice_kept: float = setting(
        0.05, "Probability from which the choice of a spring is stated.", "judgement"
    )
    hum_left: float = setting(
        0.02, "Residual share of a removed hum that no cause has to explain.", "judgement"
    )
    noise_explains: float = setting(
        1.0,
        "Gap below which misbehaving noise explains all of it.",
        "judgement",
        "The noise itself once more.",
        unit="noise variances of a sample",
    )
    shares_chance: float = setting(
        1.0,
        "Standard deviation of a share of the gap above which the shares of all sets are chance.",
        "convention",
        "As large as the gap itself.",
    )
    noise_excused: float = setting(
        0.8,
        "Explained share of so small a gap from which misbehaving noise is not its cause.",
        "judgement",
        "Effects with few parameters explain little of any noise.",
        decision="0007",
    )
