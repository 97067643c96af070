import pytest

from scenarios.openscenario import (
    ContentError,
    FileReadError,
    ParameterError,
    UnsupportedError,
    admissible,
    check,
    expand,
)

SINGLE = (
    "<DeterministicSingleParameterDistribution "
    'parameterName="{}">{}</DeterministicSingleParameterDistribution>'
)


def values(name, *elements):
    inner = "".join(f'<Element value="{e}"/>' for e in elements)
    return SINGLE.format(name, f"<DistributionSet>{inner}</DistributionSet>")


def steps(name, low, high, step):
    inner = (
        f'<DistributionRange stepWidth="{step}"><Range lowerLimit="{low}" upperLimit="{high}"/>'
        f"</DistributionRange>"
    )
    return SINGLE.format(name, inner)


def sets(*rows):
    inner = "".join(
        "<ParameterValueSet>"
        + "".join(f'<ParameterAssignment parameterRef="{k}" value="{v}"/>' for k, v in row.items())
        + "</ParameterValueSet>"
        for row in rows
    )
    return (
        "<DeterministicMultiParameterDistribution><ValueSetDistribution>"
        f"{inner}</ValueSetDistribution></DeterministicMultiParameterDistribution>"
    )


@pytest.fixture
def variation(write, tmp_path):
    def make(*distributions, kind="Deterministic", scenario="small.xosc", **parts):
        write(**parts)
        path = tmp_path / "variation.xosc"
        path.write_text(
            '<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" author="t" '
            'description="v"/>'
            f'<ParameterValueDistribution><ScenarioFile filepath="{scenario}"/>'
            f"<{kind}>{''.join(distributions)}"
            f"</{kind}></ParameterValueDistribution></OpenSCENARIO>",
            encoding="utf-8",
        )
        return path

    return make


def test_the_last_distribution_varies_fastest(variation, tmp_path):
    runs = expand(variation(steps("v", 10, 20, 5), values("light", "Sunny", "Night")))
    assert [(r.parameters["v"], r.parameters["light"]) for r in runs] == [
        (v, light) for v in ("10", "15", "20") for light in ("Sunny", "Night")
    ]
    assert runs[5].name == "variation_05"
    assert runs[0].path == (tmp_path / "small.xosc").resolve()


def test_sets_vary_together(variation):
    runs = expand(variation(sets({"a": 1, "b": 2}, {"a": 3, "b": 4}), values("c", "x", "y")))
    assert [tuple(r.parameters.values()) for r in runs] == [
        ("1", "2", "x"),
        ("1", "2", "y"),
        ("3", "4", "x"),
        ("3", "4", "y"),
    ]


def test_range_ends(variation):
    assert [r.parameters["v"] for r in expand(variation(steps("v", 0, 1, 0.1)))][-1] == "1"
    assert [r.parameters["v"] for r in expand(variation(steps("v", 0, 1, 0.4)))] == ["0", "0.4", "0.8"]
    assert len(expand(variation(steps("v", 5, 5, 1)))) == 1


LIMITED = (
    '<ParameterDeclaration name="fast" parameterType="double" value="5"/>'
    '<ParameterDeclaration name="slow" parameterType="double" value="1"><ConstraintGroup>'
    '<ValueConstraint rule="greaterThan" value="0"/><ValueConstraint rule="lessThan" value="$fast"/>'
    "</ConstraintGroup></ParameterDeclaration>"
)


def test_variations_that_break_constraints_are_left_out_and_counted(variation):
    path = variation(steps("slow", 0, 4, 1), steps("fast", 2, 4, 2), parameters=LIMITED)
    kept, line = admissible(expand(path))
    # of 5 x 2: slow is above 0 and below fast
    pairs = [(r.parameters["slow"], r.parameters["fast"]) for r in kept]
    assert pairs == [("1", "2"), ("1", "4"), ("2", "4"), ("3", "4")]
    assert line.startswith("6 of 10 variations are left out, the first: ")
    assert "slow = 0 breaks its constraints" in line
    held = check(path)
    assert (held.verdict, held.lines[0]) == ("noted", line)
    assert admissible(kept) == (kept, "")
    with pytest.raises(ParameterError, match="slow = 0 breaks its constraints"):
        admissible(expand(variation(values("slow", 0), parameters=LIMITED)))


def test_a_scenario_is_one_run(write):
    runs = expand(write())
    assert [(r.name, dict(r.parameters)) for r in runs] == [("small", {})]
    assert runs[0].source == runs[0].path


def test_a_variation_knows_the_file_that_asks_for_it(variation):
    path = variation(values("v", 1))
    assert [(r.source, r.path.name) for r in expand(path)] == [(path, "small.xosc")]


@pytest.mark.parametrize(
    ("parts", "kind", "error", "text"),
    [
        ((steps("v", 2, 1, 1),), "Deterministic", ContentError, "lies below"),
        ((steps("v", 0, 1, 0),), "Deterministic", ContentError, "stepWidth: expected a positive number"),
        ((steps("v", 0, 1e9, 1e-3),), "Deterministic", ContentError, "more than 100000"),
        ((steps("v", 0, 999, 1), steps("w", 0, 999, 1)), "Deterministic", ContentError, "more than 100000"),
        ((values("v", 1), values("v", 2)), "Deterministic", ContentError, "'v' twice"),
        ((sets({"a": 1}, {"b": 2}), values("b", 1)), "Deterministic", ContentError, "'b' twice"),
        ((values("v"),), "Deterministic", ContentError, "at least one Element"),
        ((), "Deterministic", ContentError, "at least one distribution"),
        ((), "Stochastic", UnsupportedError, "<Stochastic> is not supported"),
    ],
)
def test_refused(variation, parts, kind, error, text):
    with pytest.raises(error, match=text) as caught:
        expand(variation(*parts, kind=kind))
    assert "variation.xosc:1" in str(caught.value)


def test_missing_files(variation, tmp_path):
    with pytest.raises(FileReadError, match="does not exist"):
        expand(variation(values("v", 1), scenario="nowhere.xosc"))
    with pytest.raises(FileReadError, match=r"nowhere\.xosc: No such file"):
        expand(tmp_path / "nowhere.xosc")
