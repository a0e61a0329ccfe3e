"""The study behind a diagnosis: what was found in a campaign, before it is put in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from diagnosis.attribution.decide import UNKNOWN, Weighed
from diagnosis.attribution.hypothesis import Hypothesis
from diagnosis.attribution.random_moments import RandomAnswer
from diagnosis.detection.gap import GapTest
from diagnosis.detection.mains import Hum
from diagnosis.detection.sensor_noise import Noise, NoiseTrend
from diagnosis.fitting.least_squares import Fit
from diagnosis.fitting.similarity import Similarity
from diagnosis.localisation.place import Place, locate
from tunnel_sim.effects import the_effect
from tunnel_sim.vocabulary.campaign import Campaign

#: The effects that are read off the records before any is fitted.
HUM, COARSE_STEP = the_effect(line="mains"), the_effect(lattice=True)


@dataclass(frozen=True, eq=False)
class Study:
    """Everything found in a campaign, as `diagnosis.investigate.investigate` returns it.

    Args:
        campaign: the similar campaign (`diagnosis.fitting.similarity`), whose units all values below have.
        similarity: how it was made from the measured one.
        cleaned: the campaign without the hum, where one was found.
        noise: of the cleaned records.
        trend: of the noise with the motion.
        step: of the lattice on which the readings lie, rad; 0 where they are continuous.
        coarse: whether that step is coarser than the stated resolution.
        hum: the hum that was removed, or None.
        nominal: the fit of the nominal model to the cleaned records.
        test: whether there is a gap, after the hum is removed.
        cut: whether the start of every run and what follows its motion were left out, because the nominal model
            misses the motion grossly.
        rested: runs that end with a long rest, which the fits of effects leave out.
        place: where the gap is, from the residuals alone; None where it is not located yet.
        hypotheses: fitted sets of effects.
        weighed: answers with probabilities, the answer first; empty where there is no gap.
        random: answers with a random moment that passed its tests.
        seconds: wall time by step, s.
    """

    campaign: Campaign
    similarity: Similarity
    cleaned: Campaign
    noise: Noise
    trend: NoiseTrend
    step: float
    coarse: bool
    hum: Hum | None
    nominal: Fit
    test: GapTest
    cut: bool = False
    rested: tuple[str, ...] = ()
    place: Place | None = None
    hypotheses: tuple[Hypothesis, ...] = ()
    weighed: tuple[Weighed, ...] = ()
    random: tuple[RandomAnswer, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def read_off(self) -> tuple[str, ...]:
        """Causes read off the records before fitting."""
        found = {HUM.name: self.hum is not None, COARSE_STEP.name: self.coarse}
        return tuple(name for name, present in found.items() if present)

    @property
    def fitted(self) -> tuple[str, ...]:
        """Causes found by fitting: none, one or several, or ``unknown`` alone."""
        return self.weighed[0].effects if self.weighed else ()

    @property
    def causes(self) -> tuple[str, ...]:
        """All causes, sorted; ``unknown`` alone where nothing in the vocabulary explains the gap."""
        if self.fitted == UNKNOWN:
            return UNKNOWN
        return tuple(sorted({*self.read_off, *self.fitted}))

    @property
    def named(self) -> bool:
        """Whether there is a gap and a cause of it is named."""
        return self.causes not in ((), UNKNOWN)

    @property
    def chosen(self) -> Fit:
        """The fit of the answer; the nominal one where no fitted effect is part of it."""
        names = tuple(name for name in self.fitted if name != "unknown")
        random = self.random_answer(names)
        if random is not None:
            return self.nominal if random.beside is None else random.beside.fit
        hypothesis = self.hypothesis(names) if names else None
        return self.nominal if hypothesis is None else hypothesis.fit

    def hypothesis(self, names: Sequence[str]) -> Hypothesis | None:
        """The fitted hypothesis of these effects; None where they were not fitted together."""
        key = tuple(sorted(names))
        return next((h for h in self.hypotheses if h.names == key), None)

    def random_answer(self, names: Sequence[str]) -> RandomAnswer | None:
        """The random moment among these effects; None where none passed, or the effects close more without it."""
        key = tuple(sorted(names))
        found = next((answer for answer in self.random if answer.effects == key), None)
        steady = self.hypothesis(key)
        if found is None or steady is None:
            return found
        share = max(steady.fit.excess, 0.0) / max(self.nominal.excess, 1e-9)
        return found if found.share < share else None


def located(study: Study) -> Place:
    """Where the gap of a study is, found now where it was not found before.

    Args:
        study: up to the test of the gap.
    """
    if study.place is not None:
        return study.place
    stated = study.noise.stated_variance if study.coarse else None
    level = float(np.mean([run.noise_variance * run.block for run in study.nominal.problem.data.runs]))
    return locate(
        study.campaign,
        study.nominal,
        hum_removed=study.hum is not None,
        noise_ratio=level / stated if stated else 1.0,
    )
