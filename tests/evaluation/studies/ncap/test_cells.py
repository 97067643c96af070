"""Which cells of the protocols scenario files are, against the grids of the protocols themselves."""

import re
from collections import Counter
from pathlib import Path

import pytest

from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026
from evaluation.protocols.grid import Cell, Function, Lighting
from evaluation.protocols.robustness import Quantity
from evaluation.protocols.table import measurements
from evaluation.runs.specs import Conditions
from evaluation.studies.ncap.cells import cell_columns, changed_run, counted_otherwise, shipped_run
from evaluation.studies.ncap.grid import grid_of_files, grid_of_shipped, scenario_files
from evaluation.studies.ncap.run import protocol_for, specs_of
from scenarios.openscenario.reading.distributions import expand
from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.engine import Engine

NCAP = Path(__file__).parents[5] / "shared" / "ncap" / "scenarios" / "OpenSCENARIO" / "NCAP"


@pytest.fixture(scope="module")
def ncap() -> Path:
    if not NCAP.is_dir():
        pytest.skip(f"no reference scenarios at {NCAP}")
    return NCAP


def columns(file: Path, number: int) -> dict[str, object]:
    variation = expand(file)[number]
    return cell_columns(variation, file, load(variation.path, variation.parameters))


@pytest.mark.parametrize(
    ("file", "number", "expected"),
    [
        (
            "AEB_VRU_2023/Variations/NCAP_AEB_VRU_CPNA-25_Variation_2023.xosc",
            0,
            ("CPNA", 10.0, 25.0, 5.0, "day", "AEB"),
        ),
        (
            "AEB_VRU_2023/Variations/NCAP_AEB_VRU_CBLA-25_Variation_2023.xosc",
            6,
            ("CBLA", 80.0, 25.0, 20.0, "day", "FCW"),
        ),
        ("CA-FC_2026/Variations/StandardRange/CPLA_FCW.xosc", 0, ("CPLA", 50.0, 25.0, 5.0, "day", "FCW")),
        (
            "AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRs_FCW_Variation_2023.xosc",
            0,
            ("CCRs", 55.0, -50.0, 0.0, "day", "FCW"),
        ),
        (
            "AEB_C2C_2023/Variations/NCAP_AEB_C2C_CCRm_Variation_2023.xosc",
            0,
            ("CCRm", 30.0, -50.0, 20.0, "day", "AEB"),
        ),
        (
            "AEB_VRU_2023/Variations/NCAP_AEB_VRU_CPRA_Cm_Variation_2023.xosc",
            0,
            ("CPRA_Cm", 4.0, None, None, "day", "AEB"),
        ),
    ],
)
def test_columns_by_hand(ncap: Path, file: str, number: int, expected: tuple[object, ...]) -> None:
    found = columns(ncap / file, number)
    keys = ("scenario", "v_test_kmh", "impact_location_percent", "target_speed_kmh", "lighting", "function")
    for key, value in zip(keys, expected, strict=True):
        if value is not None:
            assert found[key] == value, key


def test_braking_cars_are_told_by_gap_and_deceleration(ncap: Path) -> None:
    file = ncap / "AEB_C2C_2023" / "Variations" / "NCAP_AEB_C2C_CCRb_Variation_2023.xosc"
    told = {columns(file, k)["condition"] for k in range(4)}
    assert told == {f"gap {gap} m, {decel} m/s2" for gap in (12, 40) for decel in (2, 6)}


def test_night_is_read_from_the_light_of_the_file(ncap: Path) -> None:
    file = ncap / "CA-FC_2026" / "Variations" / "StandardRange" / "CPNA.xosc"
    lighting = Counter(columns(file, k)["lighting"] for k in range(36))
    assert lighting == {"day": 18, "night": 18}


@pytest.mark.parametrize(
    ("name", "folder"), [("2023", "AEB_VRU_2023"), ("2023", "AEB_C2C_2023"), ("2026", "CA-FC_2026")]
)
def test_the_files_are_the_cells_of_the_protocol(ncap: Path, name: str, folder: str) -> None:
    """Every run is in a cell, and every cell of the scenarios that have files is run."""
    protocol = protocol_for(name, ("dry",))
    grid = grid_of_files(scenario_files([str(ncap / folder)]), protocol)
    assert grid.strange == ()
    covered = set()
    for run in grid.runs:
        columns = dict(run.label)
        if "layer" in columns or columns.get("condition") == "general requirement":
            continue  # what the protocol adds to the runs of the files
        impact = float(str(columns.get("impact_location_percent", 50.0)))
        fitting = {
            cell
            for cell in protocol.cells(str(columns["scenario"]))
            if cell.speed_kmh == columns["v_test_kmh"]
            and cell.impact_percent in (None, impact)
            and cell.target_speed_kmh in (None, columns.get("target_speed_kmh", cell.target_speed_kmh))
            and (cell.lighting, cell.function) == (columns["lighting"], columns["function"])
            and cell.condition == columns.get("condition", "")
        }
        assert len(fitting) == 1
        covered |= fitting
    scenarios = {cell.scenario for cell in covered}
    assert {cell for cell in protocol.cells() if cell.scenario in scenarios} == covered


def test_equal_runs_of_several_files_are_run_once(ncap: Path) -> None:
    grid = grid_of_files(scenario_files([str(ncap / "AEB_VRU_2023")]), protocol_for("2023", ("dry",)))
    assert grid.asked == 149  # 34 files
    named = [dict(run.label) for run in grid.runs if dict(run.label)["scenario"] == "CPNA"]
    assert len(named) == 22  # and not 24, with the two files of a single run
    assert len({run.spec.log for run in grid.runs if run.spec.scenario.startswith("CPNA")}) == 22


def test_files_of_another_protocol_are_told_or_refused(ncap: Path) -> None:
    r152 = protocol_for("r152", ("dry",))
    rear = ncap / "AEB_VRU_2023" / "Variations" / "NCAP_AEB_VRU_CBNA-50_Variation_2023.xosc"
    with pytest.raises(ProtocolError, match=r"no scenario belongs to the protocol: .*CBNA"):
        grid_of_files([rear], r152)
    both = grid_of_files([rear, ncap / "CA-FC_2026" / "Variations" / "StandardRange" / "CPNA.xosc"], r152)
    assert len(both.strange) > 0
    assert {dict(run.label)["impact_location_percent"] for run in both.runs} == {50.0}


@pytest.mark.parametrize("name", ["r152", "2026"])
def test_files_told_by_overlap_are_the_cells_of_the_place_that_is_hit(ncap: Path, name: str) -> None:
    """Half of the width overlaps at 97 % of it, which is no cell; all of it at 50 %, in the middle.

    A target of 1.712 m beside the middle by 0.856 m - 1.815 m * (overlap - 50 %).
    """
    files = [
        ncap / "AEB_C2C_2023" / "Variations" / f"NCAP_AEB_C2C_{n}_Variation_2023.xosc"
        for n in ("CCRs", "CCRm")
    ]
    grid = grid_of_files(files, protocol_for(name, ("dry",)), robustness=False)
    assert grid.runs
    for run in grid.runs:
        assert dict(run.label)["impact_location_percent"] == 50.0
        assert dict(run.spec.parameters)["Overlap"] == "100"
    told = {
        float(match[1])
        for s in grid.strange
        if (match := re.search(r"impact_location_percent ([\d.]+)", s.reason))
    }
    assert told >= {
        round(50 + 100 * side * (0.856 - 1.815 * part) / 1.815, 3) for side in (1, -1) for part in (0, 0.25)
    }


def test_files_told_by_impact_location_are_the_cells_of_their_overlap(ncap: Path) -> None:
    """In 2023 the middle is 100 %; the other places of 2026 overlap by 72, 47 ... %, which are no cells."""
    folder = ncap / "CA-FC_2026" / "Variations" / "StandardRange"
    grid = grid_of_files([folder / "CCRs.xosc", folder / "CCRm.xosc"], protocol_for("2023", ("dry",)))
    told = {
        (dict(r.label)["impact_location_percent"], dict(r.spec.parameters)["ImpactLocation"])
        for r in grid.runs
    }
    assert told == {(100.0, "50")}
    beside = 50 * (1.712 / 1.815 + 1)
    for percent, overlap in ((75.0, beside - 25), (25.0, 25 - beside), (100.0, beside - 50)):
        assert counted_otherwise(percent, 1.712 / 1.815, overlaps=True) == pytest.approx(overlap, abs=1e-3)
        assert counted_otherwise(overlap, 1.712 / 1.815, overlaps=False) == pytest.approx(percent, abs=2e-3)


def test_the_regulation_takes_warning_tests_for_what_the_brake_does(ncap: Path) -> None:
    """Euro NCAP drives 55 km/h and more behind a standing car for the warning; R152 goes up to 60 km/h."""
    files = [
        ncap / "AEB_C2C_2023" / "Variations" / f"NCAP_AEB_C2C_CCRs{n}_Variation_2023.xosc"
        for n in ("", "_FCW")
    ]
    grid = grid_of_files(files, protocol_for("r152", ("dry",)))
    assert sorted(run.spec.v_test_kmh for run in grid.runs) == [10, 20, 30, 40, 45, 50, 55, 60]


# ---- shipped scenarios -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["2023", "2026", "r152"])
def test_shipped_scenarios_are_the_cells_that_they_are_taken_for(name: str) -> None:
    protocol = protocol_for(name, ("dry",))
    own = ("CPNA", "CPFA", "CPNCO", "CPLA", "CBNA", "CBLA")
    wanted = [cell for cell in protocol.cells() if cell.scenario in own]
    runs = [run for run in grid_of_shipped(protocol, name).runs if "condition" not in dict(run.label)]
    assert len(runs) == len(wanted)
    for cell, run in zip(wanted, runs, strict=True):
        definition = load(*_path_and_values(cell))
        variation = shipped_run(cell)
        assert variation is not None
        # a warning test is no other scenario: what is tested is not in the file
        read = cell_columns(variation, variation.path, definition) | {
            "scenario": cell.scenario,
            "function": str(cell.function),
        }
        told = dict(run.label)
        assert {key: read[key] for key in told} == told
        assert measurements([told | {"v_impact_kmh": 0.0}], [cell]).keys() == {cell}


def _path_and_values(cell: Cell) -> tuple[Path, dict[str, object]]:
    variation = shipped_run(cell)
    assert variation is not None
    return variation.path, dict(variation.parameters)


def test_cells_without_a_shipped_scenario_are_told_apart() -> None:
    assert shipped_run(Cell("CCRs", 50.0, 50.0, 0.0)) is None
    assert shipped_run(Cell("CPTAfs", 10.0, 50.0, 5.0)) is None
    night = shipped_run(Cell("CPNA", 30.0, 50.0, 5.0, Lighting.NIGHT))
    assert night is not None
    assert night.parameters["Illuminance"] == 0.1
    warned = shipped_run(Cell("CPLA", 50.0, 25.0, 5.0, function=Function.FCW), steady_distance_m=18.0)
    assert warned is not None
    assert warned.parameters["Steady_distance"] == 18.0


# ---- changed scenarios -------------------------------------------------------------------------------------


def test_conditions_change_the_parameters_that_they_are_about() -> None:
    cell = Cell("CPNA", 40.0, 75.0, 5.0)
    base = shipped_run(cell)
    assert base is not None
    values = load(base.path, base.parameters).parameters
    # from 4 m beside the lane to 75 % of 1.8 m, counted with a point 0.06 m behind the reference point
    distance = 4.0 + 0.45 + 0.06
    for quantity, amount, name, expected in (
        (Quantity.TARGET_SPEED_KMH, 3, "Target_speed_kmh", 8.0),
        (Quantity.TARGET_SPEED_KMH, -2, "Target_speed_kmh", 3.0),
        (Quantity.START_PERCENT, -25, "Target_offset", 4.0 - 0.25 * distance),
        (Quantity.HEADING_DEG, -10, "Target_heading_deg", -10.0),
        (Quantity.ILLUMINANCE_LX, 1, "Illuminance", 1.0),
    ):
        run = changed_run(base, values, quantity, amount)
        assert run is not None
        changed = {key for key, value in run.parameters.items() if base.parameters.get(key) != value}
        assert changed == {name}
        assert run.parameters[name] == pytest.approx(expected)
    assert changed_run(base, values, Quantity.HEADWAY_S, 0.5) is None
    assert changed_run(base, values, Quantity.PATH_OFFSET_M, 0.5) is None


@pytest.mark.parametrize(
    ("file", "quantity", "amount", "name", "expected"),
    [
        # 4 m to the middle, 0.06 m to the H-point; the first run is at 25 % of 1.815 m
        ("CPNA", Quantity.START_PERCENT, -25, "VRU_initLatDist", 4 - 0.25 * (4 - 0.45375 + 0.06)),
        # 17 m steady and 7 m run-up
        ("CBNA", Quantity.START_PERCENT, -25, "VRU_steadyStateDist", 17 - 0.25 * 24),
        ("CBNA", Quantity.TARGET_SPEED_KMH, 5, "VRU_finalSpeed_kph", 20.0),
        ("CCCscp", Quantity.TARGET_SPEED_KMH, -5, "Target_final_speed_kph", 15.0),
        ("CCRb", Quantity.HEADWAY_S, 0.5, "Target_time_headway", 1.5),
        ("CCRb", Quantity.TARGET_DECELERATION_MPS2, -2, "Target_deceleration", 2.0),
        ("CPNA", Quantity.HEADING_DEG, 20, None, None),
        ("CCFtap", Quantity.PATH_OFFSET_M, 0.5, None, None),
    ],
)
def test_conditions_of_vectors_files(
    ncap: Path, file: str, quantity: Quantity, amount: float, name: str | None, expected: float | None
) -> None:
    path = ncap / "CA-FC_2026" / "Variations" / "StandardRange" / f"{file}.xosc"
    base = next(v for v in expand(path) if file != "CPNA" or float(v.parameters["ImpactLocation"]) == 25)
    run = changed_run(base, load(base.path, base.parameters).parameters, quantity, amount)
    if name is None:
        assert run is None
        return
    assert run is not None
    assert run.parameters[name] == pytest.approx(expected)
    load(run.path, run.parameters)  # no constraint of the file is broken


def test_farside_walkers_of_vectors_files_are_hit_where_their_cell_is(ncap: Path) -> None:
    """Their ImpactLocation counts from the side that the target comes from, the protocol's from the right."""
    file = ncap / "CA-FC_2026" / "Variations" / "ExtendedRange" / "CPFA.xosc"
    for number, variation in enumerate(expand(file)):
        definition = load(variation.path, variation.parameters)
        if definition.parameters["Ego_speed_kph"] != 60:
            continue
        cell = columns(file, number)["impact_location_percent"]
        hit = Engine(definition).run().impact_location_percent
        # the box's centre is 0.06 m beyond the point that counts
        assert hit == pytest.approx(float(str(cell)) - 100 * 0.06 / 1.815, abs=0.01)


def test_conditions_and_requirements_are_run_with_the_cells_that_they_change() -> None:
    protocol = EuroNcap2026()
    grid = grid_of_files(scenario_files(["cpna"]), protocol)
    cells = protocol.all_cells
    found = Counter(
        cell.condition
        for run in grid.runs
        for cell in measurements([dict(run.label) | {"v_impact_kmh": 0.0}], cells)
    )
    # the shipped grid has 25 and 75 % at 10 to 60 km/h by day
    conditions = protocol.conditions()[protocol.cells("CPNA")[1]]
    assert found == {"": 12, "general requirement": 1, **{cell.condition: 12 for _, cell in conditions}}
    slow = next(run for run in grid.runs if dict(run.label).get("condition") == "general requirement")
    values = dict(slow.spec.parameters)
    told = [float(values[key]) for key in ("Target_speed_kmh", "Ego_speed_kmh", "Impact_percent")]
    assert told == [3.0, 20.0, 75.0]
    assert len({(run.spec.log, run.spec.v_test_kmh) for run in grid.runs}) == len(grid.runs)
    assert [run.scenario for run in grid.strange] == ["CPNA"] * 10  # 15, 25 ... 55 km/h


def test_the_paper_is_run_in_every_weather_it_is_asked_for() -> None:
    protocol = protocol_for("paper", ("dry", "snow"))
    grid = grid_of_shipped(protocol, "paper")
    conditions = Conditions(("map", "rectangular"), "paper", ("dry", "snow"))
    specs = [spec for _, spec in specs_of(grid, conditions, "paper")]
    assert len(specs) == 2 * 2 * 6
    assert Counter((s.strategy, s.weather) for s in specs) == {
        (strategy, weather): 6 for strategy in ("map", "rectangular") for weather in ("dry", "snow")
    }
    with pytest.raises(ProtocolError, match="give one --weather, not dry, snow"):
        protocol_for("2023", ("dry", "snow"))
