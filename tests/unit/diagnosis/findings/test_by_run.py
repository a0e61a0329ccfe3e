"""The size of a cause by run.

Truth: decays with a cubic spring, of one size in all runs or of twice the size in one, and an offset wind speed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.answer.sizes_by_run import AGREE_RATE, sizes
from diagnosis.findings.by_run import CausesByRun
from diagnosis.findings.sections import sections
from diagnosis.likelihood.least_squares import Fit, fit
from diagnosis.model.parameters import Point
from diagnosis.result import Diagnosis
from identification.show.blocks import Detail, Paragraph
from tests.support.gap_campaigns import campaign, nominal
from tunnel_sim.effects import ALL_EFFECTS, effect_class, effect_from
from tunnel_sim.vocabulary.campaign import Campaign

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")

SIZE = 0.3
FEW = vocabulary(["cubic_stiffness", "quadratic_damping", "coulomb_friction"])
CUBIC, DOUBLE = (effect_from("cubic_stiffness", {"coefficient": factor * SIZE}) for factor in (1.0, 2.0))


def with_effect(data: Campaign, name: str, start: float) -> Fit:
    """The campaign fitted with one effect."""
    base = nominal(data)
    problem = replace(base.problem, effects=(effect_class(name),))
    return fit(problem, Point(np.append(base.point.common, start), base.point.per_run))


def cubic_of(*, seed: int = 3, double: int | None = None) -> Fit:
    data, other = campaign(CUBIC, seed=seed, duration=6.0), campaign(DOUBLE, seed=seed, duration=6.0)
    runs = tuple(other.runs[i] if i == double else run for i, run in enumerate(data.runs))
    return with_effect(replace(data, runs=runs), "cubic_stiffness", SIZE)


def test_runs_of_one_size_agree_and_their_errors_are_right() -> None:
    """Both bounds: of 60 sizes a standard deviation holds between half and five sixths."""
    inside, p_values = [], []
    for seed in range(10):
        (found,) = sizes(cubic_of(seed=seed), ALL_EFFECTS)
        assert found.alone
        assert len(found.runs) == 6
        inside += [abs(one.value - SIZE) < one.known_std for one in found.runs.values()]
        p_values.append(found.p_value)
    assert 0.5 < np.mean(inside) < 0.84  # 0.683; each bound is missed once in 380 sets of 60
    assert min(p_values) > AGREE_RATE
    assert np.mean(np.array(p_values) < 0.5) == pytest.approx(0.5, abs=0.4)


def test_a_run_with_a_size_of_its_own_is_named() -> None:
    (found,) = sizes(cubic_of(double=2), ALL_EFFECTS)
    assert found.p_value < AGREE_RATE
    assert found.farthest == "r3"
    own = found.runs["r3"]
    assert own.value == pytest.approx(2.0 * SIZE, abs=max(4.0 * own.known_std, 0.03 * SIZE))
    assert found.spread > 0.1


def test_the_common_size_of_runs_that_differ_has_the_error_of_its_form() -> None:
    """One of six equally informative runs has twice the size."""
    (alike,), (differs,) = (sizes(cubic_of(double=one), ALL_EFFECTS) for one in (None, 2))
    assert alike.form_std == 0.0
    assert differs.common.std is not None
    assert differs.form_std > 10.0 * differs.common.std  # the noise alone
    assert differs.form_std == pytest.approx(
        differs.spread * abs(differs.common.value) / np.sqrt(6.0), rel=0.2
    )


def test_a_step_finds_the_size_of_a_run_fitted_alone() -> None:
    (found,) = sizes(cubic_of(), ALL_EFFECTS)
    data = campaign(CUBIC, seed=3, duration=6.0)
    alone = with_effect(replace(data, runs=data.runs[:1]), "cubic_stiffness", SIZE)
    own, name = found.runs["r1"], "cubic_stiffness.coefficient"
    assert own.value == pytest.approx(alone.value(name), abs=0.2 * own.known_std)
    assert own.known_std == pytest.approx(alone.std(name), rel=0.1)


def test_what_only_the_comparison_of_runs_shows_is_said_with_the_others_held() -> None:
    data = campaign(duration=6.0)
    runs = tuple(replace(run, wind_speed=run.wind_speed - 0.5 * run.wind_on) for run in data.runs)
    (found,) = sizes(with_effect(replace(data, runs=runs), "wind_speed_offset", 0.5), ALL_EFFECTS)
    assert not found.alone
    assert set(found.runs) == {run.id for run in runs if run.wind_on}


@pytest.fixture(scope="module")
def answer() -> Diagnosis:
    return diagnose(campaign(CUBIC, duration=6.0), kinds=FEW)


def test_the_finding_is_said_drawn_and_read_back(answer: Diagnosis) -> None:
    assert answer.by_run is not None
    (cause,) = answer.by_run.causes
    assert cause.effect == "cubic_stiffness"
    assert cause.agrees
    assert cause.common.unit == "1/rad2"
    (section,) = (one for one in sections(answer) if one.key == "by-run")
    (detail,) = (block for block in section.blocks if isinstance(block, Detail))
    assert "Cubic stiffness: the 6 runs that show it agree on 0.300" in detail.blocks[0].text  # type: ignore[union-attr]
    assert answer.pictures["by-run"].draw() is not None
    assert Diagnosis.from_json_dict(answer.to_json_dict()).by_run == answer.by_run


def test_a_run_of_another_size_is_said_to_differ(answer: Diagnosis) -> None:
    assert answer.by_run is not None
    (cause,) = answer.by_run.causes
    odd = replace(cause.runs["r2"], value=1.5 * cause.common.value)
    differs = replace(cause, runs={**cause.runs, "r2": odd}, p_value=1e-9, spread=0.2)
    first = CausesByRun((differs,)).section(answer).blocks[0]
    assert isinstance(first, Paragraph)
    assert first.text.startswith(
        "Cubic stiffness: 0.300 1/rad² fits all runs best, but the 6 runs that show it"
    )
    assert "differ by 20 % beyond their errors (p = 1e-09), r2 the most" in first.text
