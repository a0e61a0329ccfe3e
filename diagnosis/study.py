"""The study behind a diagnosis: noise, gap, hypotheses and their weights."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np

from diagnosis.attribution.decide import UNKNOWN_SHARE, Weighed, form_floor, weigh
from diagnosis.attribution.outsiders import Outsider, weigh_outsiders
from diagnosis.attribution.random_moments import RandomAnswer, weigh_random_moments
from diagnosis.attribution.rank import Hypothesis, polish, rank_pairs, rank_singles
from diagnosis.detection.gap import GapTest, test_gap
from diagnosis.detection.mains import Hum, find_hum, refine_frequency, remove_hum
from diagnosis.detection.refusal import refuse_indefinite
from diagnosis.detection.sensor_noise import Noise, NoiseTrend, campaign_noise, noise_trend, reading_step
from diagnosis.fitting.least_squares import Fit, FitError, fit
from diagnosis.fitting.problem import Problem
from diagnosis.fitting.run_data import Data, prepare, without_start
from diagnosis.fitting.starting_points import is_gross, nominal_start
from tunnel_sim.effects import ALL_EFFECTS, Effect, the_effect
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError

Progress = Callable[[str], None]

#: The effects that are read off the records before any is fitted.
HUM, COARSE_STEP = the_effect(line="mains"), the_effect(lattice=True)
#: A reading's step beyond this multiple of the stated resolution is coarser than stated.
COARSER = 1.5
#: Power that a coarse step's error may leave outside the noise floor, in step²/12 (at most all of it, and chance).
_STEP_POWER = 1.2
#: Share of a hum's power that may be left once the line and its harmonics are out.
_HUM_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Study:
    """Everything a diagnosis found, before it is put in words.

    Args:
        campaign: as given.
        cleaned: without hum, where one was found.
        noise: of the records.
        trend: of the noise with the motion.
        step: of the lattice of the readings, rad; 0 where continuous.
        coarse: whether that is coarser than stated.
        hum: taken out, or None.
        nominal: the nominal fit.
        test: of the gap, hum taken out.
        started_late: whether the runs' starts were left out, because the nominal model misses the motion grossly.
        hypotheses: fitted effects and pairs.
        weighed: answers with probabilities; empty where there is no gap.
        random: answers with a random moment that passed.
        outsider: what outside the vocabulary closes most of the gap; None where there is no gap.
        seconds: wall time by step.
    """

    campaign: Campaign
    cleaned: Campaign
    noise: Noise
    trend: NoiseTrend
    step: float
    coarse: bool
    hum: Hum | None
    nominal: Fit
    test: GapTest
    started_late: bool = False
    hypotheses: tuple[Hypothesis, ...] = ()
    weighed: tuple[Weighed, ...] = ()
    random: tuple[RandomAnswer, ...] = ()
    outsider: Outsider | None = None
    seconds: dict[str, float] = field(default_factory=dict)

    @property
    def read_off(self) -> tuple[str, ...]:
        """Causes read off the records before fitting."""
        found = {HUM.name: self.hum is not None, COARSE_STEP.name: self.coarse}
        return tuple(name for name, present in found.items() if present)

    @property
    def fitted(self) -> tuple[str, ...]:
        """Causes the fits answer with: none, one, two, or ``unknown``."""
        return self.weighed[0].effects if self.weighed else ()

    @property
    def causes(self) -> tuple[str, ...]:
        """The answer."""
        if self.fitted == ("unknown",):
            return ("unknown",)
        return tuple(sorted({*self.read_off, *self.fitted}))

    def hypothesis(self, names: Sequence[str]) -> Hypothesis | None:
        """The fitted hypothesis of these effects, None where they were not fitted together."""
        key = tuple(sorted(names))
        return next((h for h in self.hypotheses if h.names == key), None)

    def random_answer(self, names: Sequence[str]) -> RandomAnswer | None:
        """The random moment of these effects, None where none passed or the same effects without it close more."""
        key = tuple(sorted(names))
        found = next((answer for answer in self.random if answer.effects == key), None)
        steady = self.hypothesis(key)
        if found is None or steady is None:
            return found
        share = max(steady.fit.excess, 0.0) / max(self.nominal.excess, 1e-9)
        return found if found.share < share else None


def study(
    campaign: Campaign, kinds: Sequence[type[Effect]] = ALL_EFFECTS, progress: Progress | None = None
) -> Study:
    """Fit, test and weigh.

    Args:
        campaign: the runs.
        kinds: the vocabulary to answer in.
        progress: told what is being done.

    Returns:
        What was found.

    Raises:
        TunnelError: when the runs are too few or not oscillating enough to fit the nominal model.
    """
    clock = _Clock(progress)
    allowed = {kind.name for kind in kinds}
    with clock.step("noise"):
        noise, trend, step = campaign_noise(campaign), noise_trend(campaign), reading_step(campaign)
        stated = campaign.sensor.resolution
        coarse = COARSE_STEP.name in allowed and stated is not None and step > COARSER * stated
    with clock.step("nominal fit"):
        nominal = fit_nominal(prepare(campaign, noise.variance))
        cleaned, hum = campaign, None
        line = find_hum(nominal) if HUM.name in allowed else None
        if line is not None:
            frequency = refine_frequency(campaign, line)
            cleaned, hum = remove_hum(campaign, frequency, float(np.mean(list(noise.variance.values()))))
            noise = campaign_noise(cleaned)
            nominal = fit_nominal(prepare(cleaned, noise.variance))
        started_late = is_gross(nominal)
        if started_late:
            nominal = fit_nominal(without_start(nominal.problem.data))
        test = test_gap(nominal, noise, trend, coarse_step=coarse)
    found = Study(
        campaign, cleaned, noise, trend, step, coarse, hum, nominal, test, started_late, seconds=clock.seconds
    )
    return _weigh_effects(found, kinds, clock) if test.detected else found


def fit_nominal(data: Data) -> Fit:
    """Fit the nominal model.

    Args:
        data: prepared runs.

    Returns:
        The fit.

    Raises:
        TunnelError: when no nominal model can be fitted.
    """
    try:
        found = fit(Problem(data), nominal_start(data))
    except (FitError, np.linalg.LinAlgError) as error:
        raise TunnelError(
            "the nominal model cannot be fitted",
            remedy="check spring stiffness, wind speed and that the runs are free decays of three cycles or more",
        ) from error
    refuse_indefinite(found)
    return found


def _weigh_effects(found: Study, kinds: Sequence[type[Effect]], clock: _Clock) -> Study:
    fitted_kinds = [kind for kind in kinds if kind.fitted]
    nominal = found.nominal
    with clock.step("single effects"):
        singles = rank_singles(nominal, fitted_kinds, clock.progress)
    pairs: list[Hypothesis] = []
    if singles and _share(singles[0].fit, nominal) > form_floor(nominal.excess, singles[0].effects):
        with clock.step("pairs"):
            pairs = rank_pairs(singles, fitted_kinds, clock.progress)
    hypotheses = [*singles, *pairs]
    shares = [(h.effects, _share(h.fit, nominal)) for h in hypotheses]
    with clock.step("random moments"):
        random = weigh_random_moments(nominal, singles, pairs, {kind.name for kind in kinds})
    shares += [(answer.effects, answer.share) for answer in random]
    chance = float(np.sqrt(2.0 / nominal.count)) / max(nominal.excess, 1e-3)
    outsider = weigh_outsiders(nominal)
    weighed = weigh(
        shares,
        chance,
        nominal.excess,
        UNKNOWN_SHARE if outsider is None else outsider.share,
        {h.names: h.forms for h in hypotheses},
    )
    if weighed[0].effects == ("unknown",) and _read_off_explains(found):
        weighed = []  # what is left belongs to the cause read off the records
    elif weighed[0].effects != ("unknown",):
        with clock.step("polishing"):
            hypotheses = _polished(hypotheses, weighed[0], random)
    if found.test.noisy and weighed and nominal.excess < _share_of_noise(found):
        named = [Weighed(w.effects, w.share, 0.0) for w in weighed if w.effects != ("unknown",)]
        weighed = [Weighed(("unknown",), 1.0, 1.0), *named]
    return Study(
        found.campaign, found.cleaned, found.noise, found.trend, found.step, found.coarse, found.hum, nominal,
        found.test, found.started_late, tuple(hypotheses), tuple(weighed), tuple(random), outsider,
        clock.seconds,
    )  # fmt: skip


def _polished(
    hypotheses: Sequence[Hypothesis], answer: Weighed, random: Sequence[RandomAnswer]
) -> list[Hypothesis]:
    """The hypotheses with the answer's own fitted to the end, unless a random moment answers."""
    if any(moment.effects == answer.effects for moment in random):
        return list(hypotheses)
    return [polish(h) if h.names == answer.effects else h for h in hypotheses]


def _share(fitted: Fit, nominal: Fit) -> float:
    """Share of the nominal gap that a fit leaves open."""
    return max(fitted.excess, 0.0) / max(nominal.excess, 1e-9)


def _read_off_explains(found: Study) -> bool:
    """Whether what is left is no more than a coarse step or a removed hum leaves by itself.

    The error of a coarse step is not white: its power is step²/12, wherever in the spectrum it lies. A hum that
    is no pure line leaves a small share of itself.
    """
    left = found.nominal.excess / found.nominal.problem.data.runs[0].block
    variance = float(np.mean(list(found.noise.variance.values())))
    if found.coarse and left * variance < _STEP_POWER * found.step**2 / 12.0:
        return True
    return found.hum is not None and left < _HUM_SHARE * found.hum.excess


def _share_of_noise(found: Study) -> float:
    """Excess of block means below which a misbehaving noise is the whole gap."""
    return 1.0 * found.nominal.problem.data.runs[0].block


class _Clock:
    """Wall time by step, and the progress call."""

    def __init__(self, progress: Progress | None) -> None:
        self.seconds: dict[str, float] = {}
        self.progress = progress

    @contextmanager
    def step(self, name: str) -> Iterator[None]:
        """Time a step."""
        if self.progress is not None:
            self.progress(name)
        begun = time.perf_counter()
        yield
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - begun
