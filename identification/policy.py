"""The judgements of this package: false-alarm rates, and limits that another engineer might set differently.

Each states its source. Numerical constants, such as the tolerance of an iteration or the size of a grid, are
defined where they are used.
"""

from __future__ import annotations

from collections.abc import Mapping

# --- False-alarm rates: how often a correct campaign is called wrong. ---

REFUSAL_RATE = 1e-6
"""Rate of refusing correct runs or labels. It withholds an estimate, so it must not happen in a lifetime."""

REFUSAL_DEVIATIONS = 4.75
"""`REFUSAL_RATE` in one-sided standard deviations of a normal distribution."""

QUESTION_RATE = 1e-5
"""Rate of questioning correct statements, of each possible slip. A question withholds nothing; with a hundred
possible slips less than one correct campaign in a hundred is asked about."""

MISFIT_RATE = 1e-3
"""Rate of false departures of a record, a line or a set of runs from its model; they only widen intervals."""

MISFIT_DEVIATIONS = 3.29
"""`MISFIT_RATE` in two-sided standard deviations of a normal distribution."""

DIFFERENCE_RATE = 0.01
"""Rate of false differences: between two scores, by an input of a result, in scatter of runs beyond stated
uncertainties, or between two springs as well known as `SPRING_AT_BEST`."""

DIFFERENCE_DEVIATIONS = 2.58
"""`DIFFERENCE_RATE` in two-sided standard deviations of a normal distribution."""

SPRING_FLAG_RATE = 0.10
"""Rate of flagging a correct set of springs. A flag costs one weighing, hence not 5 %. The rate was chosen knowing
Table II of the paper, whose p-value is 0.06: springs 4 and 7 are flagged at this rate but not at 5 %."""

# --- Uncertainty of the rig's inputs. ---

SPRING_TOLERANCE = 0.01
"""Relative standard uncertainty of a stated stiffness: weights and arm of a static calibration."""

SPRING_AT_BEST = 0.003
"""Relative standard uncertainty of a carefully calibrated spring: a few parts in a thousand. Two springs disagree
only where even such springs would."""

INERTIA_FACTOR = 1.5
"""Greatest relative error of a nominal inertia, as a factor: it comes from a drawing, without the support and the
added mass of air. Confusing one spring with two makes 2. Judgement."""

WITHHELD_INERTIA = 5.0
"""Ratio of the springs' inertia to the stated one from which no coefficients are given: no drawing is so wrong.
Judgement."""

SAME_PRESSURE = 0.1
"""Relative difference below which dynamic pressures are one setting: speeds are measured to a few per cent."""

LEAST_SPRING_SPREAD = 0.01
"""Relative difference above which two stiffnesses are different: a spring is known to a few parts in a thousand at
best."""

LEAST_SPRING_RESOLUTION = 10.0
"""Rise of ωn² over the springs, in its standard deviations, that a wind-off line needs. Noise in the abscissa
attenuates the gradient by the inverse square: here 1 %, a tenth of its standard deviation."""

SPRING_DEPARTURE = 0.25
"""Relative departure of a spring from its statement that an effect may cause: calibration, gravity, a flexible rod.
Greater departures may be slips. Judgement."""

SPEED_DEPARTURE = 0.03
"""Relative departure of a wind speed by an effect: calibration, an offset, the stream's unevenness. Judgement."""

SLIP_AGREES = 0.1
"""False-alarm rate of disagreement for runs with right labels and departures as large as the two above. Another
label is offered only where all agree better."""

SCATTER_OF_STIFFNESS = 0.002
"""Relative scatter of ωn² between runs of equal statements, besides its change along the run: a spring clamped anew
repeats to a few parts in ten thousand, and the amplitude of the release may change it. Judgement."""

SCATTER_OF_DAMPING = 0.02
"""Relative scatter of the decay rate between runs of equal statements: bearings repeat to a per cent or two."""

LEVELS_OF_SCATTER = (0.02, 5.0)
"""Least and greatest scatter between runs that chance is believed to cause, in `USUAL_SCATTER`. Judgement."""

AGREEING_SCATTER = 2.0
"""Greatest scatter, in `USUAL_SCATTER`, of runs that agree with a slip: a large scatter hides which slip it is."""

SCATTER_FREEDOM = 4
"""Degrees of freedom of `USUAL_SCATTER` where few runs show their scatter: it is known within a factor of two.
Judgement."""

DAMPING_OF_SPRINGS = 0.1
"""Relative difference of the damping with the wind off between springs: hysteresis of the springs. Judgement."""

DAMPING_DEPARTURE = 0.5
"""Such a difference as an effect may cause, dry friction among them. Judgement."""

LEAST_DAMPING_STD = 2e-4
"""Least relative standard deviation of a decay rate: no fit is more accurate beside small effects. Judgement."""

LEAST_FACTOR: Mapping[str, float] = {
    "wind_speed": 0.075,
    "air_density": 0.15,
    "air_density of a group": 0.05,
    "spring_stiffness": 0.05,
    "time_s": 0.01,
    "idle": 0.1,
    "along": 0.05,
}
"""Least relative error of a statement that is called a slip; smaller ones are calibration or scatter. Of a wind in
runs that state none, over the least stated wind; along a campaign, from its first to its last run. That of a speed
is 2.5 times `SPEED_DEPARTURE`, so that runs whose speeds scatter as widely are not slips. Judgement."""

LEAST_OF_WIND = 0.005
"""Least relative change of ωn² by the wind that a campaign is designed to measure. Judgement."""

LEAST_DAMPING_OF_WIND = 0.1
"""Least relative change of the decay rate by the wind: air that passes a body adds to its damping. Judgement."""

ZERO_STEADINESS = 0.03
"""Relative difference of the zeros of runs up to which they are one zero of two signs."""

LEAST_STEPS = 4.0
"""Least number of resolution steps in a swing: a coarser sensor would not have been chosen. Judgement."""

FINER_THAN_STATED = 0.03
"""Ratio of noise to resolution: rounding alone makes 0.29, so a tenth of that contradicts the resolution."""

OTHER_SPRING = 1.2
"""Ratio of ωn² of runs of equal statements and swings that only another spring explains: scatter and wear remain
below a few per cent. Judgement."""

OTHER_NUMBER = 0.05
"""Relative disagreement of the stated springs from which another numbering is tried: calibrations are closer.
Judgement."""

OTHER_WIND = (1.02, 1.3)
"""Ratios of ωn² and of the decay rate, both at once, that only another wind speed explains. Judgement."""

NOISE_RATIO = 0.15
"""Tolerance of the ratio of two runs' noise from one sensor."""

SCATTER_OF_NOISE = 0.02
"""Relative scatter of the noise of one sensor between runs, besides chance, where few runs show it. Judgement."""

SCATTER_OF_RELEASE = 0.03
"""Relative scatter of the first swing about the stated release, where few runs show it: by hand. Judgement."""

ODD_NOISE = 3.5
"""Ratio of a run's noise to the other runs' by which it is odd: simulated runs of one sensor differ by a
fifth, and one run of a measured campaign in the data differs by three times from all others. Judgement."""

FILTERED_NOISE = 5.0
"""Such a ratio, in a run with less noise, that only a filter or a smoothed file explains. Judgement."""

LEAST_DRIFT = 5e-4
"""Relative change of a clock's rate along a run that is a drift: quartz keeps 1e-4, and a rig's temperature changes
a spring by a few times that."""

RELEASE_AS_STATED = (0.5, 1.5)
"""Ratio of a record's first angle to the stated release angle, where it begins at the release: the angle is
nominal, and the body is released by hand. Judgement."""

CLEAR_RELEASE = 0.8
"""Share of the amplitude at which a record must begin for the side of its release to be known."""

GREATEST_YAW_MOMENT = 10.0
"""Greatest |Cnβ|, 1/rad. By frontal area and length of the body, vehicles and slender bodies have 0.1 to 2."""

BODY_DENSITIES = (5.0, 30_000.0)
"""kg/m³: a body as light as four times its air, or denser than lead, is more likely a wrong unit."""

NOISE_TOLERANCE = 0.05
"""Relative uncertainty of a stated or measured noise level, as on data sheets."""

LEAST_NOISE = 1e-7
"""Least ratio of noise to the largest reading: no sensor and no integrator does better."""

LEAST_STIFFNESS_STD = 1e-5
"""Least relative standard deviation of k: no clock and no fit is more accurate."""

# --- Evidence that a record must give. ---

LEAST_SAMPLES = 8
"""Samples of a run: five unknowns describe it, and at least three more samples test the description."""

LEAST_ENERGY = 56.0
"""Energy of the decay over the noise variance. Noise alone reaches it, at the best of all frequencies of a record
of 1e6 samples, less than once in 1e6 runs: 2 ln(1e12)."""

LEAST_WINDOW_ENERGY = 400.0
"""Energy of a window over the noise variance, N(A/S)²/2: its amplitude is then known to 5 %."""

LEAST_PROMINENCE = 40.0
"""Power of a spectral peak over the median's; white noise alone reaches it less than once in 1e6 records."""

FEW_CYCLES = 3.0
"""Cycles below which a run's status warns: drift and decay are then hard to distinguish."""

LEAST_PEAK_HEIGHT = 10.0
"""Height of a peak over its standard deviation, for the logarithmic decrement: below it the noise in a logarithm is
not symmetric."""

LEAST_PEAK_SHARE = 0.1
"""Height of a peak over the first one, for the conventional method, which does not know the noise; for the same
reason."""

LEAST_ENVELOPE = 4.0
"""Amplitude of the Hilbert envelope over its standard deviation: averages of half a cycle need less than peaks."""

GREATEST_NETWORK_DISTANCE = 0.1
"""Root mean square distance of three cycles from a damped oscillation, over its amplitude. Beyond it the networks
are not used: they were trained on damped oscillations."""

CLEAR_SWING = 0.2
"""Share of a run's largest swing down to which its peaks show the centre: smaller swings may end off it, where dry
friction stops the body. Judgement."""

EQUAL_SWINGS = 0.8
"""Ratio of two swings that are equal when centres are compared: effects of the amplitude change by less than half.
Judgement."""

GROSS_MISFIT = 0.01
"""Share of a reading's power in the residual beyond which a fit misses the motion itself: a tenth of the swing.
Judgement, also used by `tunnel diagnose`."""

LEAST_FOR_SCATTER = 3
"""Number of values whose scatter is used as their uncertainty."""

SCATTER_TOLERANCE = 1.2
"""Factor on χ² of the networks' windows: their propagated standard deviations are good to a tenth."""

# --- When a wind-on run excites itself. ---

LEAST_GROWTH_WINDOWS = 4
"""Windows of three cycles of a growing part and of a limit cycle: a line through them leaves two degrees of freedom
for its scatter."""

LEAST_STEADY_CYCLES = 20.0
"""Cycles of a record of constant amplitude. With `STEADY_CHANGE`, a free decay would need ζ below 0.0008, less
than the wind alone adds to any rig. Judgement."""

STEADY_CHANGE = 0.1
"""Greatest change of the amplitude's logarithm along a steady record, at the upper end of its interval.
Judgement."""

SETTLED_SHARE = 0.9
"""Share of the last amplitude from which a growing motion has settled: windows scatter by a few per cent.
Judgement."""

LINEAR_SHARE = 0.3
"""Amplitude over the limit cycle's, up to which a growth is linear: a saturation that grows as the square of
the amplitude reduces the growth rate there by 9 %, and by some 2 % on average."""

# --- When a random moment is assumed. ---

LEAST_MOMENT_DROP = 1.0
"""Drop of −2 ln L: a smaller one is not evidence of a random moment."""

MOMENT_DROP_FOR_CORNER = 20.0
"""Drop of −2 ln L from which the spectrum of the moment is estimated: the moment must be clear first."""

LEAST_CORNER_DROP = 4.0
"""Further drop of −2 ln L, two standard deviations, that a corner frequency must bring."""

# --- When two parameters trade off. ---

TRADE_OFF_CORRELATION = 0.95
"""Absolute correlation from which two parameters trade off: the variance of each is then ten times what it would be
with the other known, the customary sign of collinearity in regression (a variance inflation factor 1/(1 − r²) of
10)."""

# --- When the scatter of the runs is significant, and when two scores differ. ---

LEAST_WIDTH_FREEDOM = 1.0
"""Least degrees of freedom of a variance with estimated widths: two runs show one difference."""

REPEATING = 2.0
"""Standard deviations below the usual width, from which all narrower widths between runs are equally probable. Some
rigs, simulated ones among them, repeat exactly. Judgement: the density there is e⁻² of the greatest, which makes it
about one rig in six."""

LEAST_CHANGE = 0.02
"""Relevant change of a bias or a spread, over the spread, where both trials use the same records."""

OUTLIER_MEDIANS = 6.0
"""Size of an outlier in medians of the errors' sizes: four standard deviations where errors are normal."""

SAFE_DEVIATIONS = 3.0
"""Standard deviations by which the stiffness and the damping of a proposed run must be positive."""
