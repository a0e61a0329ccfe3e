"""Expressions: what is read, what is refused, and the compiled program against NumPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tunnel_sim.physics.expression import FUNCTIONS, Expression, parse
from tunnel_sim.physics.moment_law import forward_library, operation_names
from tunnel_sim.vocabulary.dimensions import dimension
from tunnel_sim.vocabulary.errors import TunnelError

NAMES = frozenset({"b", "r", "t", "V", "k", "w"})
INPUTS = {"b": "angle", "r": "rate", "t": "time", "V": "speed"}
DETENT = "-k*b*exp(-(b/w)^2)"


def compiled(program: tuple[float, ...], inputs: np.ndarray) -> np.ndarray:
    """Values of a program from the compiled law; the columns of ``inputs`` are b, r, t and V."""
    code, given_ = np.array(program), np.ascontiguousarray(inputs)
    out = np.empty(len(given_))
    forward_library().vwt_evaluate(
        code.size, code.ctypes.data, len(given_), given_.ctypes.data, out.ctypes.data
    )
    return out


def code(text: str, **constants: float) -> tuple[float, ...]:
    return parse(text, NAMES).program(constants, INPUTS)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("2+3*4", 14.0),
        ("-2^2", -4.0),
        ("2^3^2", 512.0),
        ("(1-3)*abs(-2)/4", -1.0),
        ("max(1, min(5, 3)) - pi", 3.0 - math.pi),
        ("sign(-3)+sign(0)+sign(2)*10", 9.0),
        ("1e-3*2", 0.002),
        ("+3--1", 4.0),
    ],
)
def test_arithmetic_is_that_of_mathematics(text: str, value: float) -> None:
    assert parse(text, NAMES).value({}) == pytest.approx(value, rel=1e-15)
    assert compiled(code(text), np.zeros((1, 4)))[0] == pytest.approx(value, rel=1e-15)


_LEAVES = st.sampled_from(["b", "r", "t", "V", "k", "w", "0", "1.5", "0.3", "pi"])
_FORMULAS = st.recursive(
    _LEAVES,
    lambda inner: st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from(["+", "-", "*", "/", "^"]), inner),
        st.builds("{}({})".format, st.sampled_from([f for f in FUNCTIONS if f not in ("min", "max")]), inner),
        st.builds("{}({}, {})".format, st.sampled_from(["min", "max"]), inner, inner),
        st.builds("-{}".format, inner),
        st.builds("{}^{}".format, inner, st.sampled_from(["2", "3"])),
    ),
    max_leaves=8,
)


@settings(max_examples=300, deadline=None)
@given(_FORMULAS)
@example("sign(sqrt(b))")
@example("max(sqrt(b), min(log(r), t))")
def test_the_compiled_law_and_numpy_agree(text: str) -> None:
    rng = np.random.default_rng(1)
    inputs = np.vstack([np.zeros(4), rng.normal(0.0, 1.0, (30, 4))])
    formula = parse(text, NAMES)
    values = dict(zip("brtV", inputs.T, strict=True)) | {"k": 0.7, "w": 1.3}
    expected = np.broadcast_to(formula.value(values), 31)
    found = compiled(formula.program({"k": 0.7, "w": 1.3}, INPUTS), inputs)
    # a quotient or tangent near its pole magnifies the last digit, in which the two libraries differ
    usual = ~(np.abs(expected) > 1e6) & ~(np.abs(found) > 1e6)
    np.testing.assert_allclose(found[usual], expected[usual], rtol=1e-6, atol=1e-9)


def test_constants_are_folded() -> None:
    assert len(code("-k*w^2*sqrt(w)*b^3", k=2.0, w=0.1)) == 5  # a number, its value, b, cube, multiply


@pytest.mark.parametrize(
    "text",
    [
        "", " ", "b +", "__import__('os')", "b.real", "[b]", "b if b else r", "lambda: b", "b = 1", "b; r",
        "b or r", "f'{b}'", "b // r", "b := 1",
        "b < r", "'b'", "exp", "exp()", "exp(b, r)", "max(b)", "exp(*b)", "exp(x=b)", "open(b)", "b[0]", "~b",
        "b % r", "b @ r", "1e999", "True", "None", "1j", "9" * 400, "(" * 90 + "b" + ")" * 90 + "+",
        "b\x00", "b # r + (", "1if b else 2", "...", "b\nr",
    ],
)  # fmt: skip
def test_what_is_not_a_formula_is_refused_in_one_line(text: str) -> None:
    with pytest.raises(TunnelError) as refusal:
        parse(text, NAMES)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 500


@settings(max_examples=500, deadline=None)
@given(st.text(alphabet="brtVkw()+-*/^., 0123456789eπ'\"[]{}\n#:=<&|~@\\\x00", max_size=60))
def test_any_text_is_a_formula_or_refused(text: str) -> None:
    try:
        formula = parse(text, NAMES)
    except TunnelError:
        return
    assert formula.names <= NAMES


def test_length_and_depth_are_limited() -> None:
    with pytest.raises(TunnelError, match="501 characters"):
        parse("b" + "+b" * 250, NAMES)
    with pytest.raises(TunnelError, match="nested too deep"):
        parse("b^(" * 60 + "b" + ")" * 60, NAMES)
    for count in (200, 400, 499):  # more levels than Python's stack allows
        formula = parse("-" * count + "b", NAMES)
        assert formula.value({"b": 2.0}) == 2.0 * (-1.0) ** count
        assert formula.names == {"b"}
    assert compiled(code("-" * 399 + "b"), np.array([[2.0, 0.0, 0.0, 0.0]]))[0] == -2.0
    assert parse("-+" * 200 + "-b", NAMES).dimension({"b": dimension("rad")}) == dimension("rad")


def test_an_unknown_name_is_suggested() -> None:
    with pytest.raises(TunnelError, match="unknown name 'beta'; use one of V, b"):
        parse("-k*beta", NAMES)


UNITS = {"b": "rad", "r": "rad/s", "t": "s", "V": "m/s", "k": "N m/rad", "w": "rad"}


def dimensions() -> dict[str, tuple[float, float, float]]:
    return {name: dimension(unit) for name, unit in UNITS.items()}


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        (DETENT, "N m"),
        ("k*tanh(b/w) + 0", "N m"),
        ("max(k*b, 0)", "N m"),
        ("sqrt(V^2)*t", "m"),
        ("sin(r*t)^0.5", "1"),
        ("(k*r)^-2", "s2/(N m N m)"),
        ("atan(b/w)^b", "1"),
        ("abs(r)*r", "1/s2"),
    ],
)
def test_units_are_multiplied_and_divided(text: str, unit: str) -> None:
    assert parse(text, NAMES).dimension(dimensions()) == pytest.approx(dimension(unit))


@pytest.mark.parametrize("text", ["k + b", "exp(r)", "b^t", "r^w", "min(V, 1)", "sin(k*b)", "k*b - r"])
def test_units_that_do_not_fit_are_refused(text: str) -> None:
    with pytest.raises(TunnelError):
        parse(text, NAMES).dimension(dimensions())


def op(*parts: str | float) -> tuple[float, ...]:
    return tuple(float(operation_names().index(p)) if isinstance(p, str) else p for p in parts)


@pytest.mark.parametrize(
    "program",
    [
        op("add"),
        op("number"),
        op("angle", "angle"),
        op("angle", "exp", "add"),
        (99.0,), (-1.0,), (math.nan,), (1e300,),
        op("angle") * 40 + op("add") * 39,
    ],
)  # fmt: skip
def test_a_malformed_program_is_not_a_number_rather_than_a_crash(program: tuple[float, ...]) -> None:
    assert np.isnan(compiled(program, np.ones((1, 4)))[0])


def test_expressions_are_values() -> None:
    assert parse(DETENT, NAMES) == parse(DETENT, NAMES) != Expression("b", "b")
