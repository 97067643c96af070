import pytest

from scenarios.openscenario import ParameterError, load


def declare(name, value, kind="double", inner=""):
    return (
        f'<ParameterDeclaration name="{name}" parameterType="{kind}" '
        f'value="{value}">{inner}</ParameterDeclaration>'
    )


def constraint(rule, value):
    return f'<ValueConstraint rule="{rule}" value="{value}"/>'


def test_values_refer_to_one_another_in_any_order(write):
    parameters = declare("mps", "${$kmh/3.6}") + declare("kmh", 36) + declare("copy", "$mps")
    assert load(write(parameters=parameters)).parameters["copy"] == 10.0
    assert load(write(parameters=parameters), {"kmh": "72"}).parameters["copy"] == 20.0
    assert load(write(parameters=parameters), {"kmh": 18}).parameters["copy"] == 5.0


def test_a_circle_is_named(write):
    parameters = declare("a", "${$b+1}") + declare("b", "$c") + declare("c", "${2*$a}")
    with pytest.raises(ParameterError, match=r"small\.xosc:3: .*circle: a -> b -> c -> a"):
        load(write(parameters=parameters))


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        ("double", "1e-3", 0.001),
        ("int", "-4", -4.0),
        ("integer", "7", 7.0),
        ("unsignedInt", "7", 7.0),
        ("boolean", "true", True),
        ("boolean", "0", False),
        ("string", "5", "5"),
        ("string", "${1/4}", "0.25"),
        ("double", "\\$", None),
        ("double", "50 km/h", None),
        ("double", "nan", None),
        ("double", "1_000", None),
        ("int", "1.5", None),
        ("unsignedShort", "-1", None),
        ("boolean", "yes", None),
    ],
)
def test_types(write, kind, value, expected):
    path = write(parameters=declare("p", value, kind))
    if expected is None:
        with pytest.raises(ParameterError, match=rf"p: expected a value of type {kind}"):
            load(path)
    else:
        assert load(path).parameters["p"] == expected


GROUPS = (
    f"<ConstraintGroup>{constraint('greaterOrEqual', 1)}{constraint('lessThan', '$top')}</ConstraintGroup>"
    f"<ConstraintGroup>{constraint('equalTo', -1)}</ConstraintGroup>"
)


@pytest.mark.parametrize(("value", "holds"), [(1, True), (1.9, True), (2, False), (0, False), (-1, True)])
def test_constraints_of_a_group_hold_together_and_groups_are_alternatives(write, value, holds):
    path = write(parameters=declare("top", 2) + declare("p", 1.5, inner=GROUPS))
    if holds:
        assert load(path, {"p": value}).parameters["p"] == value
    else:
        with pytest.raises(
            ParameterError, match="breaks its constraints: greaterOrEqual 1 and lessThan 2 or"
        ):
            load(path, {"p": value})


def test_text_constraints(write):
    groups = "".join(
        f"<ConstraintGroup>{constraint('equalTo', v)}</ConstraintGroup>" for v in ("Sunny", "Night")
    )
    path = write(parameters=declare("light", "Sunny", "string", groups))
    assert load(path, {"light": "Night"}).parameters["light"] == "Night"
    with pytest.raises(ParameterError, match="light = Dusk breaks"):
        load(path, {"light": "Dusk"})


def test_unknown_and_double_names(write):
    with pytest.raises(ParameterError, match="parameter 'speed' is not declared; declared: p"):
        load(write(parameters=declare("p", 1)), {"speed": 3})
    with pytest.raises(ParameterError, match="a second time"):
        load(write(parameters=declare("p", 1) + declare("p", 2)))
    with pytest.raises(ParameterError, match=r"small\.xosc:4: .*expected a value of type boolean"):
        load(write(variables='<VariableDeclaration name="v" variableType="boolean" value="maybe"/>'))
