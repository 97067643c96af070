import math

import numpy as np
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


# Stochastic distributions

RANGE = '<Range lowerLimit="{}" upperLimit="{}"/>'


def stochastic(name, inner):
    return f'<StochasticDistribution parameterName="{name}">{inner}</StochasticDistribution>'


@pytest.fixture
def draw(variation):
    """Values of one parameter, drawn."""

    def make(inner, count=4000, seed='randomSeed="7"'):
        path = variation(stochastic("v", inner), kind="Stochastic")
        text = path.read_text(encoding="utf-8").replace(
            "<Stochastic>", f'<Stochastic numberOfTestRuns="{count}" {seed}>'
        )
        path.write_text(text, encoding="utf-8")
        return [run.parameters["v"] for run in expand(path)]

    return make


def log_normal(mean, variance):
    """Mean and variance of the logarithm."""
    spread = math.log(1.0 + variance / mean**2)
    return math.log(mean) - 0.5 * spread, spread


@pytest.mark.parametrize(
    ("inner", "transform", "mean", "variance"),
    [
        ('<NormalDistribution expectedValue="3" variance="4"/>', lambda x: x, 3.0, 4.0),
        ('<LogNormalDistribution expectedValue="3" variance="2"/>', np.log, *log_normal(3.0, 2.0)),
        ('<PoissonDistribution expectedValue="2.5"/>', lambda x: x, 2.5, 2.5),
        (f"<UniformDistribution>{RANGE.format(2, 8)}</UniformDistribution>", lambda x: x, 5.0, 3.0),
        # normal, cut at its mean: half-normal, mean sqrt(2/pi), variance 1 - 2/pi
        (
            f'<NormalDistribution expectedValue="0" variance="1">{RANGE.format(0, 50)}</NormalDistribution>',
            lambda x: x,
            math.sqrt(2.0 / math.pi),
            1.0 - 2.0 / math.pi,
        ),
        # two bins of equal weight: uniform on 0 to 1 and on 3 to 4
        (
            f'<Histogram><Bin weight="2">{RANGE.format(0, 1)}</Bin><Bin weight="2">{RANGE.format(3, 4)}</Bin>'
            "</Histogram>",
            lambda x: x,
            2.0,
            1.5**2 + 1.0 / 12.0,
        ),
    ],
)
def test_drawn_values_have_the_moments_of_their_distribution(draw, inner, transform, mean, variance):
    values_drawn = transform(np.array([float(v) for v in draw(inner)]))
    # five standard errors of 4000 values; a variance has about twice the relative error of a normal one's
    assert values_drawn.mean() == pytest.approx(mean, abs=5 * math.sqrt(variance / 4000))
    assert values_drawn.var() == pytest.approx(variance, rel=0.2)


@pytest.mark.parametrize("low", [8.0, -9.0])
def test_a_range_far_in_a_tail_holds(draw, low):
    limits = RANGE.format(low, low + 1)
    inner = f'<NormalDistribution expectedValue="0" variance="1">{limits}</NormalDistribution>'
    numbers = np.array([float(v) for v in draw(inner, 200)])
    assert ((numbers >= low) & (numbers <= low + 1)).all()
    # beyond z the tail falls like exp(-z x): its mean is about 1 / z further out
    assert numbers.mean() == pytest.approx(8.0 + 1 / 8.12 if low > 0 else -8.0 - 1 / 8.12, abs=0.03)


def test_a_poisson_range_has_its_limits(draw):
    inner = f'<PoissonDistribution expectedValue="2">{RANGE.format(1, 3)}</PoissonDistribution>'
    drawn = draw(inner)
    # probabilities of 1, 2, 3 are as 2 : 2 : 4/3
    shares = [drawn.count(str(k)) / 4000 for k in (1, 2, 3)]
    assert shares == pytest.approx([0.375, 0.375, 0.25], abs=0.04)
    assert sum(shares) == 1.0


def test_a_probability_set_is_drawn_by_its_weights_and_never_without_one(draw):
    elements = "".join(f'<Element value="{v}" weight="{w}"/>' for v, w in (("a", 3), ("b", 0), ("c", 1)))
    drawn = draw(f"<ProbabilityDistributionSet>{elements}</ProbabilityDistributionSet>")
    assert drawn.count("a") / 4000 == pytest.approx(0.75, abs=0.04)
    assert set(drawn) == {"a", "c"}


def test_the_same_seed_draws_the_same_and_more_runs_begin_alike(draw):
    inner = '<NormalDistribution expectedValue="0" variance="1"/>'
    first = draw(inner, 20)
    assert draw(inner, 40)[:20] == first
    assert draw(inner, 20, 'randomSeed="8"') != first
    assert draw(inner, 20, 'randomSeed="7.5"') != first
    assert draw(inner, 20, "") == draw(inner, 20, "")


@pytest.mark.parametrize(
    ("inner", "count", "error", "text"),
    [
        ('<UserDefinedDistribution type="x">y</UserDefinedDistribution>', 3, UnsupportedError, "UserDefined"),
        ("<UniformDistribution/>", 3, ContentError, "Range"),
        ('<NormalDistribution expectedValue="0" variance="-1"/>', 3, ContentError, "variance"),
        ('<PoissonDistribution expectedValue="-1"/>', 3, ContentError, "expectedValue"),
        ('<NormalDistribution expectedValue="0" variance="1"/>', 0, ContentError, "numberOfTestRuns"),
        ('<NormalDistribution expectedValue="0" variance="1"/>', 10**6, ContentError, "numberOfTestRuns"),
        (
            f'<PoissonDistribution expectedValue="1">{RANGE.format(0.2, 0.8)}</PoissonDistribution>',
            3,
            ContentError,
            "no value within its Range",
        ),
        (
            '<ProbabilityDistributionSet><Element value="a" weight="0"/></ProbabilityDistributionSet>',
            3,
            ContentError,
            "weight above 0",
        ),
    ],
)
def test_stochastic_distributions_that_are_refused(draw, inner, count, error, text):
    with pytest.raises(error, match=text):
        draw(inner, count)
