"""Displacements: causes and their sizes, the analogy with angles, and texts in own units and words.

The source of truth is an integration by SciPy (`tests.support.linear`), and the analogy itself.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from diagnosis import diagnose, vocabulary
from diagnosis.findings.sections import sections
from diagnosis.model.still_air import StillAir
from diagnosis.result import Diagnosis
from identification import identify
from identification.show.blocks import as_html
from tests.marks import slow
from tests.support.linear import FORBIDDEN, Force, linear_campaign, no_force
from tunnel_lab.commands.about import schema_of
from tunnel_lab.report import render_report
from tunnel_sim.vocabulary.campaign import Campaign, Quantity
from tunnel_sim.vocabulary.freedom import DISPLACEMENT
from tunnel_sim.vocabulary.record import Record

pytestmark = pytest.mark.usefixtures("causes_alone_throughout")


def dry(force: float, width: float) -> Force:
    """Dry friction, smoothed over a velocity in m/s for the integrator."""
    return lambda x, v, k: -force * float(np.tanh(v / width))  # noqa: ARG005


def play(half_width: float) -> Force:
    """A gap on both sides of the middle, m."""
    return lambda x, v, k: k * (x - float(np.sign(x)) * max(abs(x) - half_width, 0.0))  # noqa: ARG005


def square(x: float, v: float, k: float) -> float:
    """Damping by the square of the velocity."""
    del x, k
    return -0.5 * abs(v) * v


ROOT = Path(__file__).parents[3]
CASES: dict[str, tuple[str, float, Force, float, float]] = {
    "dry friction of a stage": ("coulomb_friction", 0.02, dry(0.02, 1e-4), 20.0, 1e-3),
    "cubic spring of a beam": ("cubic_stiffness", 8e6, lambda x, v, k: -k * 8e6 * x**3, 120.0, 1e-4),  # noqa: ARG005
}
"""Cause, the true value of its first parameter, the force, the frequency (Hz) and the release (m)."""
FEW = vocabulary(("coulomb_friction", "cubic_stiffness", "quadratic_damping", "sensor_drift"))


@pytest.fixture(
    scope="module",
    params=["dry friction of a stage", pytest.param("cubic spring of a beam", marks=pytest.mark.slow)],
)
def case(request: pytest.FixtureRequest) -> tuple[Diagnosis, Campaign, str, float]:
    """A diagnosed campaign."""
    cause, truth, force, hertz, release = CASES[request.param]
    campaign = linear_campaign(0.2, (hertz, 1.6 * hertz), (release, 0.5 * release), force)
    return diagnose(campaign, kinds=FEW, rivals=()), campaign, cause, truth


def test_the_cause_is_found_with_its_size(case: tuple[Diagnosis, Campaign, str, float]) -> None:
    answer, _, cause, truth = case
    assert answer.causes == (cause,)
    size = next(iter(answer.candidates[0].parameters.values()))
    assert size.std is not None
    assert abs(size.value - truth) < max(4.0 * size.std, 0.01 * truth)
    assert "m" in size.unit or size.unit == "N"


def test_mass_and_damping_are_in_their_intervals(
    case: tuple[Diagnosis, Campaign, str, float],
) -> None:
    """Beside a spring that stiffens, too: its swing is faster than its natural frequency."""
    answer, campaign, _, _ = case
    mass, k = campaign.rig.yaw_inertia, campaign.runs[0].spring_stiffness
    assert mass is not None
    assert k is not None
    truths = {"yaw_inertia": mass, "mechanical_damping": 2.0 * 0.005 * float(np.sqrt(k * mass))}
    assert answer.coefficients.after.keys() == truths.keys()
    for name, truth in truths.items():
        found = answer.coefficients.after[name]
        assert abs(found.value - truth) < 4.0 * found.known_std, name


def test_the_natural_frequency_on_an_unknown_spring_does_not_scale_with_the_motion() -> None:
    data = linear_campaign(0.2, (20.0,), (1e-3, 5e-4))
    runs = tuple(replace(run, spring_stiffness=None) for run in data.runs)
    bare = replace(data, rig=replace(data.rig, yaw_inertia=None), runs=runs)
    found = diagnose(bare, kinds=vocabulary(("sensor_drift",))).coefficients.after["omega_n"]
    assert found.unit == "1/s"
    assert found.value == pytest.approx(2.0 * np.pi * 20.0, rel=1e-4)


@pytest.mark.parametrize("case", ["dry friction of a stage"], indirect=True)
def test_no_text_is_about_an_angle(case: tuple[Diagnosis, Campaign, str, float]) -> None:
    """In print, in the document, on the page and in its figures."""
    answer, campaign, _, _ = case
    assert answer.data is not None
    shown = [str(answer), repr(answer), repr(campaign), str(identify(campaign))]
    shown += [as_html(section.blocks, titled=True) for section in sections(answer, answer.data)]
    page = re.sub(
        r"<style.*?</style>|<script>/\*.*?</script>",
        "",
        render_report(answer, answer.data),
        flags=re.DOTALL,
    )
    charts = re.findall(r"<script type=\"application/json\".*?</script>", page, re.DOTALL)
    page = re.sub(r"<script.*?</script>|<[^>]+>", " ", page, flags=re.DOTALL)
    shown += [
        page,
        *(
            json.loads(f'"{text}"')
            for chart in charts
            for text in re.findall(r'": "((?:[^"\\]|\\.)*)"', chart)
        ),
    ]
    document = answer.to_json_dict()
    shown += [document["verdict"], *document["cautions"], *_units(document)]
    for text in (re.sub(r"(?i)virtual[ -]wind[ -]tunnel", "", one) for one in shown):
        assert not re.search(FORBIDDEN, text), re.findall(rf".{{0,40}}(?:{FORBIDDEN}).{{0,40}}", text)


def _units(document: Any) -> Iterator[str]:
    if isinstance(document, dict):
        yield from (value for key, value in document.items() if key == "unit")
        for value in document.values():
            yield from _units(value)
    elif isinstance(document, list):
        for value in document:
            yield from _units(value)


def test_it_is_read_back(case: tuple[Diagnosis, Campaign, str, float]) -> None:
    answer = case[0]
    again = Diagnosis.from_json_dict(json.loads(json.dumps(answer.to_json_dict())))
    assert again.to_json_dict() == answer.to_json_dict()
    assert str(again) == str(answer)


OF_ANGLE = re.compile(r"rad(?![a-z])|deg(?![a-z])|angle|yaw|inertia|moment(?!s$)|_nm")
"""What the names of an angle's fields contain."""


def test_the_schema_and_the_page_describe_its_names(
    case: tuple[Diagnosis, Campaign, str, float],
) -> None:
    """The names are an angle's, so that one schema serves; the page has a rule for each."""
    answer, campaign, *_ = case
    page = (ROOT / "docs/reference/diagnosis.md").read_text(encoding="utf-8")
    page = page.partition("## A displacement")[2].partition("\n## ")[0]
    ruled = set(re.findall(r"`…?(\w+)`", page))
    for name, document in (
        ("diagnosis", answer.to_json_dict()),
        ("estimate", identify(campaign).to_json_dict()),
    ):
        document = json.loads(json.dumps(document))
        jsonschema.Draft202012Validator(schema_of(name)).validate(document)
        assert document["motion"] == "displacement"
        document.pop("seconds", None)
        for key in {one for one in _keys(document) if OF_ANGLE.search(one)}:
            described = (
                key in ruled or re.search(r"_rad(_s)?$", key) or re.fullmatch(r"\w+_std|moment\w*", key)
            )
            assert described, key


def _keys(document: Any) -> Iterator[str]:
    if isinstance(document, dict):
        yield from document
    for value in document.values() if isinstance(document, dict) else document:
        if isinstance(value, dict | list):
            yield from _keys(value)


def numbers(document: Any, place: str = "") -> Iterator[tuple[str, float]]:
    """All numbers of a document by place, without times taken."""
    if isinstance(document, dict):
        for key, value in document.items():
            if key not in ("seconds", "provenance", "motion_scale"):
                yield from numbers(value, f"{place}.{key}")
    elif isinstance(document, list):
        for number, value in enumerate(document):
            yield from numbers(value, f"{place}[{number}]")
    elif isinstance(document, int | float) and not isinstance(document, bool):
        yield place, document


def scaled(campaign: Campaign, factor: float) -> Campaign:
    """The campaign of another motion."""
    runs = (
        replace(run, record=Record(run.record.time_s, factor * run.record.yaw_rad)) for run in campaign.runs
    )
    return replace(campaign, runs=tuple(runs))


@cache
def damped_by_the_square(quantity: Quantity) -> tuple[Campaign, Diagnosis]:
    found = linear_campaign(2.0, (3.0, 5.0), (0.3, 0.15), square, quantity=quantity)
    return found, diagnose(found, kinds=FEW, rivals=())


@pytest.mark.parametrize("quantity", ["angle", slow("rate")])
def test_an_angle_and_its_twin_have_the_same_numbers(quantity: Quantity) -> None:
    """Bit for bit, with other units; where the motion has the size of a rig's angle."""
    displaced, own = damped_by_the_square(quantity)
    twin = diagnose(displaced.as_angle, kinds=FEW, model=StillAir(), rivals=())
    assert own.causes == twin.causes == ("quadratic_damping",)
    offered = {name: value for name, value in twin.inclusion.items() if name in own.inclusion}
    twin = replace(twin, inclusion=offered)  # of effects that no displacement has the probability is 0
    assert dict(numbers(own.to_json_dict())) == dict(numbers(twin.to_json_dict()))
    assert [DISPLACEMENT.unit(unit) for unit in _units(twin.to_json_dict())] == list(
        _units(own.to_json_dict())
    )
    estimates = identify(displaced), identify(displaced.as_angle)
    assert dict(numbers(estimates[0].to_json_dict())) == dict(numbers(estimates[1].to_json_dict()))


def test_the_size_of_the_motion_changes_no_digit() -> None:
    """A motion of 1/1024 has the same answer, and every number is multiplied by a power of 1024."""
    usual, answer = damped_by_the_square("angle")
    shrunk = diagnose(scaled(usual, 2.0**-10), kinds=FEW, rivals=())
    large, small = (dict(numbers(one.to_json_dict())) for one in (answer, shrunk))
    assert large.keys() == small.keys()
    powers = {
        place: np.log2(abs(large[place] / small[place])) / 10.0
        for place in large
        if large[place] != small[place]
    }
    assert {round(power, 4) for power in powers.values()} <= {1.0, -1.0, -2.0}  # curves have six digits
    of_motion = {re.sub(r"\[\d+\]", "", place) for place in powers}
    assert {
        ".maps.runs.amplitude_rad",
        ".gap.misfit.noise",
        ".noise.std",
        ".sizes.amplitude_rad",
    } <= of_motion


def test_no_effect_of_the_air_is_offered() -> None:
    kinds = vocabulary(("rod_flexibility", "nonlinear_yaw_moment", "coulomb_friction"))
    answer = diagnose(linear_campaign(5.0, (2.0, 3.2), (0.02, 0.01), no_force), kinds=kinds, rivals=())
    assert answer.causes == ()
    assert "rod_flexibility" not in answer.inclusion
    assert not any("air" in clause for clause in answer.blind_spots)
