"""Tests of a protocol are valid where the unbraked ego meets the target at the place that is asked for."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.protocols.euroncap_2023 import EuroNcap2023
from evaluation.protocols.grid import Cell
from evaluation.protocols.registry import named_protocol
from evaluation.protocols.table import measurements
from evaluation.runs.conflict import Conflict, Part, Touch, conflicts, unbraked
from evaluation.studies.ncap.grid import grid_of_files, grid_of_shipped, scenario_files
from evaluation.studies.ncap.validity import _FAMILIES, why_invalid

NCAP = Path(__file__).parents[5] / "shared" / "ncap" / "scenarios" / "OpenSCENARIO" / "NCAP"
WIDTH_M, AXLE_TO_FRONT_M = 1.815, 3.528  # the VUT of Vector's files


def met_at(percent: float, **changes: object) -> Conflict:
    """A pedestrian of 5 km/h from the right, whose near face the front of an ego of 20 km/h has reached."""
    touch = Touch(
        time_s=5.0,
        entity="Target",
        ego_speed_kmh=20.0,
        entity_speed_kmh=5.0,
        part=Part.FRONT,
        ahead_m=0.25,
        left_m=WIDTH_M * (percent / 100.0 - 0.5),
        heading_ahead=0.0,
        heading_left=1.0,
        entity_length_m=0.6,
        entity_width_m=0.5,
        ego_length_m=4.358,
        ego_width_m=WIDTH_M,
        axle_to_front_m=AXLE_TO_FRONT_M,
        turns=0,
    )
    return Conflict("Target", replace(touch, **changes))  # type: ignore[arg-type]


def percent_of(width_m: float) -> float:
    """A width in percent of the ego's."""
    return 100.0 * width_m / WIDTH_M


# lateral deviations of the VUT and of a target that crosses, the latter by the ratio of the speeds; H-point
# beside the box's centre; 10 ms of walking
WALKING_M = 0.05 + 0.05 * 5 / 20 + 0.06 + 0.01 * 5 / 3.6


@pytest.mark.parametrize("side", [-1, 1])
@pytest.mark.parametrize(
    ("scenario", "tolerance_m"),
    [
        ("CPNA", WALKING_M),
        ("CBNA", WALKING_M),
        ("CPLA", 0.05 + 0.15),
        ("CBLA", 0.05 + 0.15),
        ("CCRs", 0.05 + 0.10),
        ("CMRb", 0.05 + 0.10),
        ("CCFhos", 0.05 + 0.10),
        ("CPRA_Cm", WALKING_M),
    ],
)
def test_tolerances_of_the_families(scenario: str, tolerance_m: float, side: int) -> None:
    cell = Cell(scenario, 20.0, 75.0, 5.0)
    near, far = (75.0 + side * percent_of(tolerance_m * share) for share in (0.99, 1.01))
    assert why_invalid(cell, met_at(near)) == ""
    assert why_invalid(cell, met_at(far)).startswith(
        "target off the place asked for: without braking it is met"
    )


def test_another_cell_of_the_grid_is_never_within_the_tolerance() -> None:
    """The places of the grid are 15 % apart at the edges, and 25 % else."""
    for asked, met in ((75.0, 90.0), (90.0, 75.0), (75.0, 50.0), (50.0, 25.0), (25.0, 75.0), (10.0, 25.0)):
        assert why_invalid(Cell("CPNA", 10.0, asked, 5.0), met_at(met, ego_speed_kmh=10.0))


def test_the_part_that_is_hit_must_be_the_front() -> None:
    reason = why_invalid(Cell("CPNA", 20.0, 25.0, 5.0), met_at(25.0, part=Part.SIDE))
    assert (
        reason
        == "target off the place asked for: without braking it meets the side of the ego, not its front"
    )
    # also where the grid names no place, as the paper's CPNA
    assert "meets the side" in why_invalid(Cell("CPNA", 20.0, condition="dry"), met_at(-5.0, part=Part.SIDE))
    assert why_invalid(Cell("CPNA", 20.0, condition="dry"), met_at(33.0)) == ""


def test_without_contact_every_cell_is_invalid() -> None:
    nobody = Conflict("Target", None)
    other = replace(met_at(75.0), target="Somebody else")
    for protocol in ("2023", "2026", "r152", "paper"):
        for cell in named_protocol(protocol).all_cells:
            assert why_invalid(cell, nobody).startswith("no conflict without braking")
            assert why_invalid(cell, other).startswith("no conflict with the target")


def test_every_scenario_of_the_protocols_has_a_family() -> None:
    names = {cell.scenario for name in ("2023", "2026", "r152") for cell in named_protocol(name).all_cells}
    assert names == set(_FAMILIES)


def test_overlaps_of_2023_are_impact_locations_here() -> None:
    """Overlap 75 % of a target as wide as the ego: its centre a quarter of a width to the left, 75 %."""
    same = {"entity_width_m": WIDTH_M}
    assert why_invalid(Cell("CCRs", 20.0, 75.0, 0.0), met_at(75.0, **same), overlaps=True) == ""
    assert why_invalid(Cell("CCRs", 20.0, -75.0, 0.0), met_at(25.0, **same), overlaps=True) == ""
    assert why_invalid(Cell("CCRs", 20.0, 100.0, 0.0), met_at(50.0, **same), overlaps=True) == ""
    assert why_invalid(Cell("CCRs", 20.0, 50.0, 0.0), met_at(50.0, **same), overlaps=True) != ""


@pytest.mark.parametrize(
    ("scenario", "speed_kmh", "radius_m", "turns"),
    [
        ("CPTAfs", 10.0, 9.00, 1),
        ("CPTAfo", 15.0, 11.75, 1),
        ("CBTAfo", 20.0, 14.75, 1),
        ("CPTAfo", 25.0, 14.75, 1),
        ("CPTAns", 10.0, 8.00, -1),
        ("CPTAno", 10.0, 8.00, -1),
    ],
)
def test_turning_tests_may_lie_inside_by_the_rear_axle(
    scenario: str, speed_kmh: float, radius_m: float, turns: int
) -> None:
    """Off by d^2 / (2 R) to the inside: the point of the path that is 3.528 + 0.25 m before the rear axle."""
    cell = Cell(scenario, speed_kmh, 50.0, 5.0)
    inside = (AXLE_TO_FRONT_M + 0.25) ** 2 / (2 * radius_m)
    tolerance = 0.10 + 0.05 * 5 / speed_kmh + 0.06 + 0.01 * 5 / 3.6
    for offset_m, valid in (
        (-1.01 * tolerance, False),
        (-0.99 * tolerance, True),
        (inside + 0.99 * tolerance, True),
        (inside + 1.01 * tolerance, False),
    ):
        conflict = met_at(50.0 + turns * percent_of(offset_m), ego_speed_kmh=speed_kmh, turns=turns)
        assert (why_invalid(cell, conflict) == "") is valid, offset_m
    straight_on = met_at(50.0 + turns * percent_of(inside), ego_speed_kmh=speed_kmh)
    assert why_invalid(cell, straight_on) != ""


def test_crossing_cars_are_met_a_quarter_behind_their_front() -> None:
    """4 m long, from the right: the centre is 1 m further to the right."""
    cell = Cell("CCCscp", 20.0, None, 20.0)
    shape = {"entity_length_m": 4.0, "entity_width_m": 1.7, "ahead_m": 0.85, "entity_speed_kmh": 20.0}
    assert why_invalid(cell, met_at(50.0 - percent_of(1.0), **shape)) == ""
    assert why_invalid(cell, met_at(50.0, **shape)) != ""
    tolerance = 0.05 + 0.10 + 0.01 * 20 / 3.6
    assert why_invalid(cell, met_at(50.0 - percent_of(1.0 + 0.99 * tolerance), **shape)) == ""
    assert why_invalid(cell, met_at(50.0 - percent_of(1.0 + 1.01 * tolerance), **shape)) != ""


def test_crossing_motorcyclists_meet_the_side() -> None:
    """A tenth of the ego's length behind its front, at the side that they come from."""
    cell = Cell("CMCscp", 20.0, None, 20.0)
    tenth = 0.1 * 4.358
    tolerance = 0.10 + (0.05 / (20 / 3.6) + 0.01) * 20 / 3.6
    for behind_m, part, valid in (
        (tenth, Part.SIDE, True),
        (tenth + 0.99 * tolerance, Part.SIDE, True),
        (tenth + 1.01 * tolerance, Part.SIDE, False),
        (tenth - 1.01 * tolerance, Part.SIDE, False),
        (tenth, Part.FRONT, False),
    ):
        conflict = met_at(-50.0, part=part, ahead_m=-behind_m, entity_speed_kmh=20.0)
        assert (why_invalid(cell, conflict) == "") is valid, (behind_m, part)


def test_oncoming_cars_are_met_by_the_middle_of_their_front() -> None:
    """Straight ahead, seen from an ego that has begun to turn left; its front is 2 m before the centre."""
    cell = Cell("CCFtap", 10.0, None, 30.0)
    shape = {"entity_length_m": 4.0, "entity_width_m": 1.7, "ahead_m": 2.0, "ego_speed_kmh": 10.0}
    shape |= {"heading_ahead": -1.0, "heading_left": 0.0, "entity_speed_kmh": 30.0, "turns": 1}
    inside = (AXLE_TO_FRONT_M + math.sqrt(0.5) * 1.7) ** 2 / (2 * 9.0)
    tolerance = 0.10 + 0.10 * 3 + 0.01 * 30 / 3.6
    assert why_invalid(cell, met_at(50.0, **shape)) == ""
    assert why_invalid(cell, met_at(50.0 + percent_of(inside + 0.99 * tolerance), **shape)) == ""
    assert why_invalid(cell, met_at(50.0 + percent_of(inside + 1.01 * tolerance), **shape)) != ""
    assert why_invalid(cell, met_at(50.0 - percent_of(1.01 * tolerance), **shape)) != ""


def invalid_of(name: str, folder: Path | None, every: int) -> tuple[int, list[str]]:
    """How many of a protocol's runs were looked at, and those that are invalid."""
    protocol = named_protocol(name)
    if folder is None:
        grid = grid_of_shipped(protocol, name)
    else:
        grid = grid_of_files(scenario_files([str(folder)]), protocol)
    runs = grid.runs[::every]
    found = conflicts([run.spec for run in runs])
    cells = protocol.all_cells
    overlaps = isinstance(protocol, EuroNcap2023)
    reasons = [
        f"{cell}: {reason}"
        for run in runs
        for cell in measurements([dict(run.label) | {"v_impact_kmh": 0.0}], cells)
        if (reason := why_invalid(cell, found[unbraked(run.spec)], overlaps))
    ]
    return len(runs), reasons


@pytest.mark.parametrize(("name", "every"), [("2023", 2), ("2026", 9), ("r152", 1), ("paper", 1)])
def test_shipped_tests_are_valid(name: str, every: int) -> None:
    count, invalid = invalid_of(name, None, every)
    assert count
    assert invalid == []


@pytest.mark.parametrize(("name", "folder", "every"), [("2023", "", 9), ("2026", "CA-FC_2026", 37)])
def test_tests_of_vector_are_valid(name: str, folder: str, every: int) -> None:
    if not NCAP.is_dir():
        pytest.skip("Vector's scenarios are not in ../shared/ncap")
    count, invalid = invalid_of(name, NCAP / folder, every)
    assert count > 40
    assert invalid == []
