"""Laws of a displacement in its own units: proposed, written as an effects file, read and found again.

The source of truth is an integration by SciPy (`tests.support.linear`).
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from diagnosis import diagnose
from diagnosis.remainder.formula import Formula, FormulaTerm, effect_table
from diagnosis.result import Diagnosis
from tests.marks import slow
from tests.support.linear import FORBIDDEN, linear_campaign
from tunnel_lab.commands.diagnose import write_proposal
from tunnel_sim.effects.expression_effect import read_effects
from tunnel_sim.effects.mechanics import CubicStiffness
from tunnel_sim.effects.registry import effect_class
from tunnel_sim.vocabulary.campaign import Campaign
from tunnel_sim.vocabulary.errors import TunnelError
from tunnel_sim.vocabulary.freedom import ANGLE, DISPLACEMENT

DEPTH = 2.0  # N/m
OWN = """motion = "displacement"
[[effects]]
name = "detent"
channel = "stiffness"
moment = "-k*b*exp(-(b/w)^2)"
[effects.parameters.k]
unit = "N/m"
scale = 0.5
lower = 0.0
upper = 50.0
[effects.parameters.w]
unit = "m"
scale = {usual}
lower = {least}
upper = {most}
"""
FRICTION = effect_class("coulomb_friction")


def notched(release: float) -> tuple[Campaign, float]:
    """A cart of 2 kg with a detent of 2 N/m at rest, and the detent's width, m."""
    width = 0.2 * release

    def detent(x: float, v: float, k: float) -> float:
        del v, k
        return -DEPTH * x * float(np.exp(-((x / width) ** 2)))

    releases = (release, 0.53 * release)
    return linear_campaign(2.0, (0.8, 1.1), releases, detent, zeta=0.03, noise=2e-4), width


def file_of(folder: Path, width: float) -> Path:
    path = folder / "own.toml"
    path.write_text(OWN.format(usual=1.7 * width, least=0.2 * width, most=20.0 * width))
    return path


@pytest.fixture(scope="module", params=[slow(0.15), 3e-4], ids=["a cart", "a stage"])
def found(request: pytest.FixtureRequest) -> tuple[Diagnosis, Campaign, float]:
    """A diagnosis that may name dry friction only."""
    campaign, width = notched(request.param)
    return diagnose(campaign, kinds=[FRICTION]), campaign, width


def test_a_proposed_law_has_own_units_and_the_true_sizes(
    found: tuple[Diagnosis, Campaign, float], tmp_path: Path
) -> None:
    """Whatever the size of the motion."""
    answer, _, width = found
    path = write_proposal(tmp_path / "law.toml", answer)
    assert path is not None
    document = tomllib.loads(path.read_text())
    assert document["motion"] == "displacement"
    (effect,) = document["effects"]
    assert effect["name"] == "proposed_displacement"
    assert {name: one["unit"] for name, one in effect["parameters"].items()} == {"k": "N/m", "w1": "m"}
    assert effect["parameters"]["k"]["scale"] == pytest.approx(-DEPTH, rel=0.01)
    assert effect["parameters"]["w1"]["scale"] == pytest.approx(width, rel=0.01)
    assert answer.closable is not None
    assert not re.search(FORBIDDEN, answer.closable.words)
    assert " N/m" in answer.closable.words
    assert " in the displacement b explains " in answer.closable.words


@pytest.mark.slow
def test_a_proposed_law_is_found_again(found: tuple[Diagnosis, Campaign, float], tmp_path: Path) -> None:
    answer, campaign, width = found
    path = write_proposal(tmp_path / "law.toml", answer)
    assert path is not None
    (kind,) = read_effects(path)
    again = diagnose(campaign, kinds=[FRICTION, kind])
    assert again.causes == ("proposed_displacement",)
    sizes = again.candidates[0].parameters
    assert (sizes["k"].unit, sizes["w1"].unit) == ("N/m", "m")
    assert sizes["k"].value == pytest.approx(-DEPTH, rel=0.01)
    assert sizes["w1"].value == pytest.approx(width, rel=0.01)


def test_a_file_in_own_units_is_found_with_its_sizes(
    found: tuple[Diagnosis, Campaign, float], tmp_path: Path
) -> None:
    """Its bounds are those of the campaign, of which a rig's angles know nothing."""
    _, campaign, width = found
    (kind,) = read_effects(file_of(tmp_path, width))
    answer = diagnose(campaign, kinds=[FRICTION, kind])
    assert answer.causes == ("detent",)
    sizes = answer.candidates[0].parameters
    assert sizes["k"].value == pytest.approx(DEPTH, rel=0.01)
    assert sizes["w"].value == pytest.approx(width, rel=0.01)
    mass = answer.coefficients.after["yaw_inertia"]
    assert abs(mass.value - 2.0) < 4.0 * mass.known_std
    assert not re.search(FORBIDDEN, str(answer))


def test_units_are_checked_as_a_displacements(tmp_path: Path) -> None:
    path = file_of(tmp_path, 0.03)
    text = path.read_text()
    path.write_text(text.replace('unit = "N/m"', 'unit = "N m/rad"'))
    with pytest.raises(TunnelError, match="is in kg m3/s2, not in N"):
        read_effects(path)
    path.write_text(text.replace('"displacement"', '"angle"'))
    with pytest.raises(TunnelError, match="exp of a quantity in 1/m2"):
        read_effects(path)
    path.write_text(text.replace('"displacement"', '"dispalcement"'))
    with pytest.raises(TunnelError, match=r"'motion' = 'dispalcement'.*'angle' or 'displacement'"):
        read_effects(path)


def test_a_file_of_a_displacement_is_refused_of_an_angle(tmp_path: Path) -> None:
    campaign, width = notched(0.15)
    kinds = read_effects(file_of(tmp_path, width))
    with pytest.raises(
        TunnelError, match="detent: is stated with motion = 'displacement', and the campaign has"
    ):
        diagnose(campaign.as_angle, kinds=[FRICTION, *kinds])


def test_the_sizes_of_a_file_change_with_the_campaign(tmp_path: Path) -> None:
    """Where it states its motion; those of built-in effects, and of other files, are a rig's."""
    (kind,) = read_effects(file_of(tmp_path, 0.03))

    def tripled(value: float, unit: str) -> float:
        return {"N m/rad": 3.0, "rad": 10.0}[unit] * value

    k, w = kind.similar(tripled).parameters()
    assert (k.scale, k.upper, w.lower) == pytest.approx((1.5, 150.0, 0.06))
    assert kind.similar(tripled).name == "detent"
    assert CubicStiffness.similar(tripled) is CubicStiffness
    path = tmp_path / "plain.toml"
    plain = OWN.format(usual=0.05, least=0.01, most=0.3).replace('motion = "displacement"\n', "")
    path.write_text(plain.replace("N/m", "N m/rad").replace('"m"', '"rad"'))
    (angle,) = read_effects(path)
    assert angle.similar(tripled) is angle


@pytest.mark.parametrize(
    ("text", "inner", "displaced", "of_inner"),
    [
        ("b^3", {}, "N/m3", {}),
        ("abs(r)*r", {}, "N s2/m2", {}),
        ("Kr*b^2", {}, "1/m", {}),
        ("b*exp(-(b/w)^2)", {"w": 0.1}, "N/m", {"w": "m"}),
        ("sin(n*b)", {"n": 3.0}, "N", {"n": "1/m"}),
        ("b*sin(f*t)", {"f": 2.0}, "N/m", {"f": "1/s"}),
        ("b^2*r/omega*sqrt(b^2+(r/omega)^2)", {}, "N/m4", {}),
    ],
)
def test_every_power_of_a_length_counts(
    text: str, inner: dict[str, float], displaced: str, of_inner: dict[str, str]
) -> None:
    """The unit of a coefficient of a displacement; an angle counts the radian as 1, as before."""
    formula = Formula((FormulaTerm(text, inner),), (2.0,), False, np.zeros(0), 0.0)
    own = effect_table(formula, "law", DISPLACEMENT)["parameters"]
    assert DISPLACEMENT.unit(own["k"]["unit"]) == displaced
    for name, unit in of_inner.items():
        assert DISPLACEMENT.unit(own[f"{name}1"]["unit"]) == unit
    angle = effect_table(formula, "law", ANGLE)["parameters"]
    assert "rad" not in angle["k"]["unit"]
    assert angle["k"]["scale"] == own["k"]["scale"] == 2.0
