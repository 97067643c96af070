"""Expressions `${...}` of OpenSCENARIO 1.1 to 1.3, evaluated without `eval`.

The grammar is a part of Python's: an expression is parsed by `ast`, and only the operators and functions that
the standard names are carried out. Numbers are floats, so that no expression can grow without bound.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Callable
from functools import lru_cache
from typing import TypeAlias

from scenarios.openscenario.errors import ExpressionError, OpenScenarioError

Value: TypeAlias = float | bool | str

MAX_LENGTH = 10_000
"""Longer expressions are refused."""

_REFERENCE = re.compile(r"\$([A-Za-z_]\w*)")
_PREFIX = "parameter_"
_WORDS = {"true": True, "false": False, "pi": math.pi}


def _sign(x: float) -> float:
    return math.copysign(1.0, x) if x else 0.0


def _round(x: float) -> float:
    """Round halves away from zero, as schools and C do; Python's `round` goes to the even number."""
    return math.copysign(math.floor(abs(x) + 0.5), x)


FUNCTIONS: dict[str, tuple[Callable[..., float], int]] = {
    "pow": (math.pow, 2),
    "sqrt": (math.sqrt, 1),
    "sin": (math.sin, 1),
    "cos": (math.cos, 1),
    "tan": (math.tan, 1),
    "asin": (math.asin, 1),
    "acos": (math.acos, 1),
    "atan": (math.atan, 1),
    "abs": (abs, 1),
    "sign": (_sign, 1),
    "floor": (math.floor, 1),
    "ceil": (math.ceil, 1),
    "round": (_round, 1),
    "min": (min, 2),
    "max": (max, 2),
}
"""Name: function and number of arguments."""

_ARITHMETIC: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Mod: math.fmod,
}
_NUMERAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
"""Text that is a number."""

_COMPARISONS: dict[type[ast.cmpop], Callable[[Value, Value], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}


@lru_cache(maxsize=4096)
def _parse(text: str) -> ast.expr:
    if len(text) > MAX_LENGTH:
        raise ExpressionError(f"the expression is longer than {MAX_LENGTH} characters")
    source = _REFERENCE.sub(rf"{_PREFIX}\1", text).strip()
    try:
        return ast.parse(source, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ExpressionError(f"cannot read the expression '{text}'") from None


def evaluate(text: str, parameters: Callable[[str], Value]) -> Value:
    """Value of an expression.

    Args:
        text: what stands between `${` and `}`.
        parameters: gives the value of a parameter by name.

    Raises:
        ExpressionError: the text is no expression of the standard, or it has no value.
    """
    try:
        value = _value(_parse(text), parameters)
    except OpenScenarioError:
        raise
    except (ArithmeticError, ValueError, TypeError, RecursionError) as error:
        raise ExpressionError(f"the expression '{text}' has no value ({error})") from None
    if isinstance(value, float) and not math.isfinite(value):
        raise ExpressionError(f"the expression '{text}' is not finite")
    return value


def _number(value: Value) -> float:
    if isinstance(value, bool) or (isinstance(value, str) and not _NUMERAL.fullmatch(value.strip())):
        raise TypeError(f"{value!r} is not a number")
    return float(value)  # also of a parameter that is declared as text and holds a number


def _value(node: ast.expr, parameters: Callable[[str], Value]) -> Value:
    match node:
        case ast.Constant(value=bool()) | ast.Constant(value=None):
            pass
        case ast.Constant(value=int() | float() as number):
            return float(number)
        case ast.Constant(value=str() as string):
            return string
        case ast.Name(id=name) if name.startswith(_PREFIX):
            return parameters(name.removeprefix(_PREFIX))
        case ast.Name(id=name) if name in _WORDS:
            return _WORDS[name]
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_number(_value(operand, parameters))
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _number(_value(operand, parameters))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            return not _value(operand, parameters)
        case ast.BinOp(left=left, op=op, right=right) if type(op) in _ARITHMETIC:
            return _ARITHMETIC[type(op)](
                _number(_value(left, parameters)), _number(_value(right, parameters))
            )
        case ast.BoolOp(op=op, values=values):
            truth = [bool(_value(part, parameters)) for part in values]
            return all(truth) if isinstance(op, ast.And) else any(truth)
        case ast.Compare(left=left, ops=[op], comparators=[right]) if type(op) in _COMPARISONS:
            return _COMPARISONS[type(op)](_value(left, parameters), _value(right, parameters))
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in FUNCTIONS:
            function, count = FUNCTIONS[name]
            if len(args) != count:
                raise ExpressionError(f"{name} takes {count} argument(s), got {len(args)}")
            return float(function(*(_number(_value(part, parameters)) for part in args)))
    source = ast.unparse(node).replace(_PREFIX, "$")
    raise ExpressionError(f"'{source}' is no operator, function or constant of OpenSCENARIO expressions")
