"""What users type: every form, and one clear message for every mistake."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.cli.options import parse_name, parse_names, parse_place, parse_speeds
from evaluation.errors import ArgumentError
from scenarios.places import Place


@pytest.mark.parametrize(
    ("text", "speeds"),
    [
        ("10..60", (10, 20, 30, 40, 50, 60)),
        ("10..60:5", (10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60)),
        ("30,50", (30, 50)),
        ("50,30", (30, 50)),
        ("30", (30,)),
        ("33.3", (33.3,)),
        ("10..35", (10, 20, 30)),
        ("10..60:25", (10, 35, 60)),
        ("10..11:0.25", (10, 10.25, 10.5, 10.75, 11)),
        ("12.5..20:2.5", (12.5, 15, 17.5, 20)),
        ("20..20", (20,)),
        (" 10 .. 30 : 10 , 50 ", (10, 20, 30, 50)),
        ("10..30,20..40,30", (10, 20, 30, 40)),
    ],
)
def test_speeds(text: str, speeds: tuple[float, ...]) -> None:
    assert parse_speeds(text) == speeds


@given(st.integers(1, 100), st.integers(0, 15), st.integers(1, 100))
def test_ranges_hold_every_step_and_both_ends(low: int, steps: int, step_tenths: int) -> None:
    """Steps in tenths have no exact binary form; the last speed must not get lost all the same."""
    high = low + steps * step_tenths / 10
    speeds = parse_speeds(f"{low}..{high:.1f}:{step_tenths / 10}")
    assert speeds == pytest.approx([low + k * step_tenths / 10 for k in range(steps + 1)])


@given(st.floats(0.5, 60), st.floats(0, 80), st.floats(1, 30))
def test_ranges_stay_within_their_ends(low: float, span: float, step: float) -> None:
    speeds = parse_speeds(f"{low:.6f}..{low + span + 1e-5:.6f}:{step:.6f}")
    assert speeds[0] == pytest.approx(low, abs=1e-6)
    assert low + span - step - 1e-4 <= speeds[-1] <= low + span + 1e-4
    assert list(speeds) == sorted(set(speeds))


@given(st.lists(st.integers(1, 140), min_size=1, max_size=6))
def test_lists_are_sorted_and_each_speed_comes_once(values: list[int]) -> None:
    assert parse_speeds(",".join(map(str, values))) == tuple(sorted(set(map(float, values))))


@pytest.mark.parametrize(
    "text",
    [
        *("", " ", ",", "30,", "abc", "10..", "..60", "10..abc", "10..60:", "10..60:x", "10:5", "10..20..30"),
        *(
            "0",
            "-10",
            "0..60",
            "60..10",
            "10..60:0",
            "10..60:-5",
            "nan",
            "inf",
            "10..inf",
            "10..60:nan",
            "1e999",
        ),
        *("10...60", "10 60", "10;60", "10-60", "1..140:0.001"),
    ],
)
def test_wrong_speeds_are_named_with_the_right_form(text: str) -> None:
    with pytest.raises(ArgumentError, match="--speeds: ") as caught:
        parse_speeds(text)
    assert "\n" not in str(caught.value)
    assert any(hint in str(caught.value) for hint in ("10..60:5", "larger step"))


@given(st.text(max_size=20))
def test_any_text_gives_speeds_or_one_clear_error(text: str) -> None:
    try:
        speeds = parse_speeds(text)
    except ArgumentError:
        with pytest.raises(ArgumentError, match=r"^--speeds: "):
            parse_speeds(text)
    else:
        assert speeds
        assert all(0 < v < float("inf") for v in speeds)


@pytest.mark.parametrize(
    ("text", "names"),
    [("map", ("map",)), ("map,all", ("map", "all")), (" all , map ,", ("all", "map")), ("map,map", ("map",))],
)
def test_names(text: str, names: tuple[str, ...]) -> None:
    assert parse_names(text, ("map", "all"), "--strategy") == names


@pytest.mark.parametrize(
    ("text", "message"), [("mapp", "unknown 'mapp'"), ("map,x", "unknown 'x'"), ("", "nothing")]
)
def test_wrong_names_are_answered_with_the_right_ones(text: str, message: str) -> None:
    with pytest.raises(ArgumentError, match=f"--strategy: {message}.*: map, all$"):
        parse_names(text, ("map", "all"), "--strategy")


def test_a_single_name_is_single() -> None:
    assert parse_name(" paper ", ("paper", "physical"), "--preset") == "paper"
    for text in ("paper,physical", "", "Paper"):
        with pytest.raises(ArgumentError, match=r"--preset: unknown '.*'.*; use one of: paper, physical"):
            parse_name(text, ("paper", "physical"), "--preset")


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("1,-1,250.0", ("1", -1, 250.0)),
        (" a7 , 2 , 1e1 ", ("a7", 2, 10.0)),
        # The id of a road is any text.
        ("a/b,c d,-1,5", ("a/b,c d", -1, 5.0)),
    ],
)
def test_places(text: str, place: tuple[str, int, float]) -> None:
    assert parse_place(text) == Place(*place)


def test_no_place() -> None:
    assert parse_place(None) is None


@pytest.mark.parametrize(
    "text", ["", "1", "1,-1", "1,-1,2,x", "1,x,2", "1,-1,x", "1,1.5,2", "1,-1,nan", "1,-1,inf"]
)
def test_wrong_places_are_answered_with_an_example(text: str) -> None:
    with pytest.raises(ArgumentError, match=r"--at: expected ROAD,LANE,S such as 1,-1,250\.0; got "):
        parse_place(text)
