"""Expressions such as ``-k*b*exp(-(b/w)^2)``: parsed, checked for units, evaluated or compiled for the moment law.

Nothing is evaluated as Python: an expression is a tree of the operations in ``mjcf/plugin/expression.h``.
"""

from __future__ import annotations

import ast
import functools
import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias, cast

import numpy as np

from tunnel_sim.physics.moment_law import operation_names
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.dimensions import NUMBER, Dimension, in_si, product
from tunnel_sim.vocabulary.errors import TunnelError, did_you_mean, one_line
from tunnel_sim.vocabulary.record import Array

#: A number, a name, or an operation and its operands.
Node: TypeAlias = "float | str | tuple[Any, ...]"

_BINARY = {ast.Add: "add", ast.Sub: "subtract", ast.Mult: "multiply", ast.Div: "divide", ast.Pow: "power"}
FUNCTIONS = ("abs", "sign", "sqrt", "exp", "log", "sin", "cos", "tan", "tanh", "atan", "min", "max")
"""The functions of an expression."""

_NUMERICS: Mapping[str, Callable[..., Any]] = {
    "add": np.add, "subtract": np.subtract, "multiply": np.multiply, "divide": np.divide, "power": np.power,
    "min": np.fmin, "max": np.fmax, "negative": np.negative, "square": lambda x: x * x, "cube": lambda x: x * x * x,
    "abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "exp": np.exp, "log": np.log, "sin": np.sin, "cos": np.cos,
    "tan": np.tan, "tanh": np.tanh, "atan": np.arctan,
}  # fmt: skip


@dataclass(frozen=True)
class Expression:
    """A formula: its text as stated, and the tree of its operations."""

    text: str
    root: Node

    @functools.cached_property
    def names(self) -> frozenset[str]:
        """The names in the expression."""
        return frozenset(_names(self.root))

    def value(self, values: Mapping[str, float | Array]) -> Array:
        """The value for numbers or arrays, shape (n,), by name in SI units; not finite where it is undefined."""
        with np.errstate(all="ignore"):
            return np.asarray(_value(self.root, values), np.float64)

    def dimension(self, dimensions: Mapping[str, Dimension]) -> Dimension:
        """The dimension, with a check of every operation; quantities of different dimensions cannot be added."""
        return _dimension(self.root, dimensions) or NUMBER

    def program(self, constants: Mapping[str, float], inputs: Mapping[str, str]) -> tuple[float, ...]:
        """The moment law's code (``mjcf/plugin/expression.h``) with constants in SI units and inputs."""
        return _code(_folded(self.root, constants), inputs)


def parse(text: str, names: frozenset[str]) -> Expression:
    """Read an expression of numbers, known names, ``pi``, ``+ - * / ^``, parentheses and `FUNCTIONS`."""
    if len(text) > limits.EXPRESSION_CHARACTERS:
        remedy = f"give one of {limits.EXPRESSION_CHARACTERS} or fewer"
        raise TunnelError(f"an expression of {len(text)} characters", remedy=remedy)
    if "#" in text:  # Python would read the rest as a comment
        raise _refused(f"{one_line(text)!r} is not a formula")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)
            warnings.simplefilter("ignore", DeprecationWarning)
            tree = ast.parse(text.strip().replace("^", "**"), mode="eval")
        root = _node(tree.body, names)
    except (SyntaxError, ValueError, MemoryError, RecursionError, OverflowError):
        raise _refused(f"{one_line(text)!r} is not a formula") from None
    if _height(root) > _DEEPEST:
        raise _refused("an expression nested too deep")
    return Expression(text, root)


_DEEPEST = 24  # maximum number of values kept at once; the compiled law has room for 32


def _refused(what: str) -> TunnelError:
    return TunnelError(what, remedy=f"write numbers, names, + - * / ^ ( ) and {', '.join(FUNCTIONS)}")


def _node(tree: ast.expr, names: frozenset[str]) -> Node:
    """The tree of an expression from Python's tree."""
    match tree:
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            if math.isfinite(value):
                return float(value)
        case ast.Name(id=name):
            if name == "pi":
                return math.pi
            if name not in names:
                raise TunnelError(f"unknown name {one_line(name)!r}", remedy=did_you_mean(name, names))
            return name
        case ast.UnaryOp(op=ast.USub() | ast.UAdd()):
            negative, inner = False, cast(ast.expr, tree)
            # in a loop, because hundreds of signs exceed Python's recursion limit
            while isinstance(inner, ast.UnaryOp) and isinstance(inner.op, ast.USub | ast.UAdd):
                negative ^= isinstance(inner.op, ast.USub)
                inner = inner.operand
            return ("negative", _node(inner, names)) if negative else _node(inner, names)
        case ast.BinOp(op=operator, left=left, right=right) if type(operator) in _BINARY:
            return _BINARY[type(operator)], _node(left, names), _node(right, names)
        case ast.Call(func=ast.Name(id=name), args=list(given), keywords=[]) if name in FUNCTIONS:
            if len(given) == (2 if name in ("min", "max") else 1):
                return name, *(_node(one, names) for one in given)
    raise _refused(f"{one_line(ast.unparse(tree))!r} is not part of a formula")


def _names(node: Node) -> set[str]:
    if isinstance(node, tuple):
        return set().union(*(_names(one) for one in node[1:]))
    return {node} if isinstance(node, str) else set()


def _height(node: Node) -> int:
    """Number of values that the program keeps at once."""
    if not isinstance(node, tuple):
        return 1
    return max(i + _height(one) for i, one in enumerate(node[1:]))


def _value(node: Node, values: Mapping[str, float | Array]) -> Any:
    if isinstance(node, tuple):
        return _NUMERICS[node[0]](*(_value(one, values) for one in node[1:]))
    return values[node] if isinstance(node, str) else np.float64(node)


def _folded(node: Node, constants: Mapping[str, float]) -> Node:
    """The tree with all constants evaluated, and with products for small powers."""
    if isinstance(node, str):
        return constants.get(node, node)
    if not isinstance(node, tuple):
        return node
    operation, *parts = node[0], *(_folded(one, constants) for one in node[1:])
    numbers = [np.float64(part) for part in parts if isinstance(part, float)]
    if len(numbers) == len(parts):
        with np.errstate(all="ignore"):
            return float(_NUMERICS[operation](*numbers))
    if operation == "power" and parts[1] in (2.0, 3.0):
        return ("square" if parts[1] == 2.0 else "cube"), parts[0]
    return operation, *parts


def _code(node: Node, inputs: Mapping[str, str]) -> tuple[float, ...]:
    number = operation_names().index
    if isinstance(node, tuple):
        parts = [element for one in node[1:] for element in _code(one, inputs)]
        return *parts, float(number(node[0]))
    if isinstance(node, str):
        return (float(number(inputs[node])),)
    return float(number("number")), node


def _dimension(node: Node, known: Mapping[str, Dimension]) -> Dimension | None:
    """The dimension of a node; None for zero, which fits any."""
    if isinstance(node, str):
        return known[node]
    if not isinstance(node, tuple):
        return None if node == 0.0 else NUMBER
    operation, *parts = node
    of = [_dimension(part, known) for part in parts]
    if operation in ("add", "subtract", "min", "max"):
        if of[0] is not None and of[1] is not None and of[0] != of[1]:
            what = f"{operation} of {in_si(of[0])} and {in_si(of[1])}"
            raise TunnelError(what, remedy="both must have the same unit")
        return of[0] or of[1]
    if operation in ("negative", "abs"):
        return of[0]
    first, other = of[0] or NUMBER, of[-1] or NUMBER
    if operation in ("multiply", "divide"):
        return product(first, other, -1.0 if operation == "divide" else 1.0)
    if operation == "power":
        if other != NUMBER:
            raise TunnelError(f"an exponent in {in_si(other)}", remedy="an exponent is a number")
        if first == NUMBER:
            return NUMBER
        power = _folded(parts[1], {})
        if not isinstance(power, float):
            what = f"a quantity in {in_si(first)} to the power of a parameter"
            raise TunnelError(what, remedy="divide it by one of the same unit")
        return product(NUMBER, first, power)
    if operation == "sqrt":
        return product(NUMBER, first, 0.5)
    if first != NUMBER and operation != "sign":
        raise TunnelError(f"{operation} of a quantity in {in_si(first)}", remedy="its argument is a number")
    return NUMBER


# Terms of the moment law as expressions of angle b (rad) and rate r (rad/s): the coefficient that enables the term,
# the effect in words, and the moment (N m).
_CUBIC = "-Kr*stiffness_cubic*0.2^3*abs(b/0.2)^stiffness_cubic_exponent*sign(b)"
_SQUARE = "-Kr*stiffness_quadratic*0.2^2*abs(b/0.2)^stiffness_quadratic_exponent"
_DAMPING = "-quadratic_damping*2^2*abs(r/2)^quadratic_damping_exponent*sign(r)"
OF_ANGLE = (
    ("stiffness_cubic", "cubic stiffness", _CUBIC),
    ("stiffness_quadratic", "asymmetric stiffness", _SQUARE),
    ("free_play", "free play", "Kr*max(-free_play, min(free_play, b))"),
    ("gravity_stiffness", "gravity stiffness", "-gravity_stiffness*sin(b-gravity_angle)"),
)
OF_RATE = (("quadratic_damping", "quadratic damping", _DAMPING),)
TEXTBOOK_POWERS = {
    "stiffness_cubic_exponent": 3.0,
    "stiffness_quadratic_exponent": 2.0,
    "quadratic_damping_exponent": 2.0,
}
