import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.openscenario.errors import ExpressionError, ParameterError
from scenarios.openscenario.expressions import evaluate

VALUES = {"a": 3.0, "b": 0.5, "yes": True, "name": "Night", "_x": -2.0}


def value(text):
    def lookup(name):
        if name not in VALUES:
            raise ParameterError(f"parameter '{name}' is not declared")
        return VALUES[name]

    return evaluate(text, lookup)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("1+2*3", 7.0),
        ("(1+2)*3", 9.0),
        ("-$a/2", -1.5),
        ("7%4", 3.0),
        ("-7%4", -3.0),  # the remainder has the sign of the dividend, as fmod has
        ("pow($a, 2)+sqrt(16)", 13.0),
        ("2*pi", 2 * math.pi),
        ("sin(pi/2)-cos(pi)+tan(0)", 2.0),
        ("acos(0)+asin(0)+atan(1)", 0.75 * math.pi),
        ("abs(-2)+sign(-5)+sign(0)+sign(9)", 2.0),
        ("floor(2.7)+ceil(2.1)+round(2.5)", 8.0),
        ("round(-2.5)", -3.0),
        ("min(1.0,100.0-$a)+max(2,$b)", 3.0),
        ("$_x*$_x", 4.0),
        ("not $yes", False),
        ("$a > 2 and $b < 1", True),
        ("$a <= 2 or false", False),
        ("$name == 'Night'", True),
        ("$a != 3", False),
    ],
)
def test_value(text, expected):
    assert value(text) == pytest.approx(expected)


@pytest.mark.parametrize(
    "text",
    [
        "1/0",
        "sqrt(-1)",
        "acos(2)",
        "pow(10, 400)",
        "1 +",
        "$a $b",
        "$name+1",
        "$yes+1",
        "__import__('os')",
        "$a.__class__",
        "[1,2][0]",
        "lambda: 1",
        "pow(1)",
        "exp(1)",
        "1 if 1 else 2",
        "1 < 2 < 3",
        "(" * 500 + "1" + ")" * 500,
        "1" * 20_000,
    ],
)
def test_no_value(text):
    with pytest.raises(ExpressionError) as error:
        value(text)
    assert "\n" not in str(error.value)


def test_unknown_parameter():
    with pytest.raises(ParameterError, match="'nobody'"):
        value("$nobody+1")


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6), st.floats(1e-3, 1e3))
def test_arithmetic_is_that_of_floats(a, b, c):
    names = {"a": a, "b": b, "c": c}
    assert evaluate("($a-$b)*$c+$a/$c", names.__getitem__) == (a - b) * c + a / c
