"""Numbers as printed. The expected texts are worked out by hand."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from identification.printing import coefficient_label
from identification.show.numbers import concise, in_stds, significant, unit, unit_mark, with_std


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (0.495123, 0.00123, "0.4951 ± 0.0012"),
        (-0.11397, 0.0448, "-0.114 ± 0.045"),
        (12.5324, 0.0996, "12.53 ± 0.10"),
        (0.1014, 0.000999, "0.1014 ± 0.0010"),
        (1234.5, 210.0, "1230 ± 210"),
        (1234.5, 21.0, "1234 ± 21"),
        (1.23456e-5, 5.6e-7, "(1.235 ± 0.056)e-05"),
        (0.105864597, 6.3e-7, "0.10586460 ± 0.00000063"),
        (1.23456e-9, 5.6e-11, "(1.235 ± 0.056)e-09"),
        (3.2e7, 1.0e5, "(3.200 ± 0.010)e+07"),
        (1.0e-7, 9.6e-6, "(0.1 ± 9.6)e-06"),
        (0.0, 0.05, "0.000 ± 0.050"),
        (0.2, 2.8e-17, "0.2 ± 2.8e-17"),
        (5.0, 0.0, "5.000000 ± 0"),
        (5.0, None, "5.000 (std unknown)"),
    ],
)
def test_the_deviation_decides_the_digits(value: float, std: float | None, text: str) -> None:
    assert with_std(value, std) == text


@given(
    value=st.floats(-1e12, 1e12, allow_nan=False),
    std=st.floats(1e-12, 1e12, allow_nan=False),
)
def test_what_is_printed_is_within_half_a_digit_of_what_is_meant(value: float, std: float) -> None:
    text = with_std(value, std)
    mantissa, _, power = text.partition(")e")
    scale = 10.0 ** int(power) if power else 1.0
    shown_value, shown_std = (float(part) * scale for part in mantissa.lstrip("(").split(" ± "))
    assert math.isclose(shown_std, std, rel_tol=0.06)  # two significant digits
    assert abs(shown_value - value) <= max(0.051 * std, 1e-9 * abs(value))


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.495, "0.4950"),
        (16.12, "16.12"),
        (0.018, "0.01800"),
        (1.2e-7, "1.200e-07"),
        (0.0, "0"),
        (123456.0, "123456"),
    ],
)
def test_a_number_without_deviation_has_four_digits(value: float, text: str) -> None:
    assert significant(value) == text


@pytest.mark.parametrize(
    ("error", "std", "text"),
    [
        (0.1, 0.125, "+0.8 σ"),
        (-3.0, 1.0, "-3.0 σ"),
        (1.0, 0.0, "–"),
        (1.0, None, "–"),
        (2e5, 1.0, "+2e+05 σ"),
    ],
)
def test_an_error_in_deviations(error: float, std: float | None, text: str) -> None:
    assert in_stds(error, std) == text


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (12.3397608, 0.0000091, "12.3397608(91)"),
        (-0.114, 0.0448, "-0.114(45)"),
        (0.8, 0.0996, "0.80(10)"),
        (12.34, 1.49, "12.3(1.5)"),
        (1234.5, 21.0, "1234(21)"),
        (1234.5, 210.0, "1230(210)"),
        (1.23456e-9, 5.6e-11, "(1.235 ± 0.056)e-09"),
        (5.0, None, "5.000 (std unknown)"),
    ],
)
def test_the_short_notation(value: float, std: float | None, text: str) -> None:
    assert concise(value, std) == text


def test_units_are_printed_with_their_powers() -> None:
    assert unit("kg m2") == "[kg m²]"
    assert unit("1/rad") == "[1/rad]"


@pytest.mark.parametrize(
    ("unit", "shown"),
    [("m3/rad", "m³/rad"), ("N m s2/rad2", "N m s²/rad²"), ("1/(kg m2)", "1/(kg m²)"), ("m4/rad", "m⁴/rad"),
     ("rad/s2", "rad/s²"), ("1/rad", "1/rad"), ("l/V", "l/V"), ("1", "1")],
)  # fmt: skip
def test_powers_of_units_are_raised(unit: str, shown: str) -> None:
    assert unit_mark(unit) == shown


def test_coefficients_have_symbol_and_unit() -> None:
    assert coefficient_label("cn_beta", "1/rad") == "Cnβ [1/rad]"
    assert coefficient_label("cn_r_area_length2", "m4/rad") == "Cnr·A·l² [m⁴/rad]"
    assert coefficient_label("other", "s") == "other [s]"
