"""What the gap costs: moments of the air, by their definition ½ρV²Al Cnβ β and ½ρVAl² Cnr r."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace
from typing import Any

import jsonschema
import pytest

from diagnosis.findings.finding import Answered
from diagnosis.findings.sections import sections
from diagnosis.findings.what_it_costs import WhatItCosts
from diagnosis.result import Diagnosis
from identification.show.blocks import TextTable
from identification.show.quantity import Quantity
from tests.support.diagnosis_document import campaign, document, findings_of
from tunnel_lab.commands.about import schema_of

AREA, LENGTH, DENSITY, TOP = 0.036, 0.625, 1.2, 21.5
BEFORE = {"cn_beta": Quantity(0.5, 0.01, "1/rad"), "cn_r": Quantity(-0.2, None, "1/rad", bound="lower")}
AFTER = {
    "cn_beta": Quantity(0.4, 0.002, "1/rad", interval=(0.397, 0.405)),
    "cn_r": Quantity(-0.1, 0.001, "1/rad"),
}


def found(
    before: Any = BEFORE, after: Any = AFTER, *, named: bool = True, data: Any = None
) -> WhatItCosts | None:
    study: Any = SimpleNamespace(named=named)
    return WhatItCosts.find(Answered(data or campaign(), study, before, after))


def test_moments_are_those_of_the_definition_at_the_top_speed() -> None:
    costs = found()
    assert costs is not None
    assert costs.wind_speed == TOP
    at_angle, at_rate = costs.moments
    angle = 0.5 * DENSITY * TOP**2 * AREA * LENGTH * math.radians(1.0)
    rate = 0.5 * DENSITY * TOP * AREA * LENGTH**2 * math.radians(1.0)
    assert at_angle.after.value == pytest.approx(0.4 * angle)
    assert at_angle.after.std == pytest.approx(0.002 * angle)
    assert at_angle.after.interval == pytest.approx((0.397 * angle, 0.405 * angle))
    assert at_rate.before.value == pytest.approx(-0.2 * rate)
    assert at_rate.before.bound == "lower"


def test_sizes_that_are_not_stated_are_in_the_coefficient() -> None:
    whole = found()
    product = {"cn_beta_area_length": Quantity(0.4 * AREA * LENGTH, 0.001, "m3/rad")}
    costs = found(product, product)
    assert whole is not None
    assert costs is not None
    assert costs.moments[0].after.value == pytest.approx(whole.moments[0].after.value)


def test_nothing_is_said_without_causes_wind_or_coefficients() -> None:
    still = campaign()
    assert found(named=False) is None
    assert found({}, {}) is None
    assert found({"zeta": Quantity(0.01, 0.001, "1")}, {"zeta": Quantity(0.01, 0.001, "1")}) is None
    assert found(data=type(still)(still.name, still.rig, still.sensor, still.runs[:1])) is None


def test_a_coefficient_at_a_bound_is_said_to_be_and_has_no_change() -> None:
    costs = found()
    assert costs is not None
    section = costs.section(findings_of(document()))
    table = section.blocks[0]
    assert isinstance(table, TextTable)
    assert table.rows[0][-1] == "-20.00 ± 0.78 %"  # 1.96 · 0.002 / 0.5: the nominal number is exact
    assert table.rows[1][-1] == "–"
    assert "(at its lower bound)" in table.rows[1][1]


@pytest.mark.parametrize(("after", "shown"), [(0.499999, "0.000 ± 0.020 %"), (0.51, "+2.000 ± 0.020 %")])
def test_a_change_of_nothing_has_no_sign(after: float, shown: str) -> None:
    costs = found(after={"cn_beta": Quantity(after, 5e-5, "1/rad")})
    assert costs is not None
    table = costs.section(findings_of(document())).blocks[0]
    assert isinstance(table, TextTable)
    assert table.rows[0][-1] == shown


def test_every_face_and_the_document_have_it() -> None:
    costs = found()
    given = findings_of(document())
    answer = Diagnosis(**{**vars(given), "costs": costs})
    written = json.loads(json.dumps(answer.to_json_dict()))
    jsonschema.Draft202012Validator(schema_of("diagnosis")).validate(written)
    assert Diagnosis.from_json_dict(written).costs == costs
    keys = [section.key for section in sections(answer)]
    assert keys.index("costs") == keys.index("uncertainty") + 1
    assert str(answer).count("oments of the air") == 1
    assert answer.plot("costs").axes
    assert "costs" not in [section.key for section in sections(given)]
