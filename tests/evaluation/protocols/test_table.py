"""Finished runs find their cells."""

from __future__ import annotations

import pandas as pd
import pytest

from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2023 import EuroNcap2023
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026
from evaluation.protocols.grid import Cell, Function, Layer, Lighting, Measurement
from evaluation.protocols.registry import PROTOCOLS, named_protocol
from evaluation.protocols.table import measurements

CELLS = EuroNcap2026().cells()
CPNA = {"scenario": "CPNA", "v_test_kmh": 60.0, "impact_location_percent": 25.0, "v_impact_kmh": 12.5}


def test_a_run_fills_the_cells_that_fit() -> None:
    found = measurements([{**CPNA, "lighting": "night"}], CELLS)
    assert found == {
        Cell("CPNA", 60.0, 25.0, 5.0, Lighting.NIGHT): Measurement(12.5, speed_reduction_kmh=47.5)
    }
    assert len(measurements([CPNA], CELLS)) == 2  # no word about the light: day and night


def test_a_data_frame_of_runs_with_empty_cells() -> None:
    frame = pd.DataFrame(
        [
            {**CPNA, "lighting": "day", "warning_ttc_s": 2.1},
            {**CPNA, "v_test_kmh": 50.0, "lighting": "day"},
            {"scenario": "CCFtap", "v_test_kmh": 15.0, "target_speed_kmh": 45.0, "v_impact_kmh": 0.0},
        ]
    )
    found = measurements(frame.to_dict("records"), CELLS)
    assert [m.warning_ttc_s for m in found.values()] == [2.1, None, None]
    assert Cell("CCFtap", 15.0, None, 45.0) in found
    nullable = measurements(frame.convert_dtypes().to_dict("records"), CELLS)
    assert nullable == found


def test_the_worst_of_several_runs_counts() -> None:
    crossing = {"scenario": "CCCscp", "v_test_kmh": 40.0, "target_speed_kmh": 40.0}
    runs = [
        {**crossing, "v_impact_kmh": v, "warning_ttc_s": t} for v, t in ((0.0, 2.0), (7.0, 1.5), (3.0, 2.5))
    ]
    assert list(measurements(runs, CELLS).values()) == [Measurement(7.0, 1.5, 33.0)]
    silent = [*runs, {**crossing, "v_impact_kmh": 0.0}]
    assert list(measurements(silent, CELLS).values()) == [Measurement(7.0, None, 33.0)]


def test_impact_is_relative_to_a_target_ahead() -> None:
    run = {
        "scenario": "CPLA",
        "v_test_kmh": 60.0,
        "impact_location_percent": 50.0,
        "function": "AEB",
        "lighting": "day",
        "v_impact_kmh": 18.0,
        "target_speed_at_contact_kmh": 5.0,
    }
    (measured,) = measurements([run], CELLS).values()
    assert measured == Measurement(13.0, None, 42.0)
    (avoided,) = measurements([{**run, "v_impact_kmh": 0.0}], CELLS).values()
    assert avoided.impact_speed_kmh == 0.0
    run.pop("target_speed_at_contact_kmh")
    with pytest.raises(ProtocolError, match="target_speed_at_contact_kmh"):
        measurements([run], CELLS)


def test_warned_and_braked_rows_are_told_apart_by_the_function() -> None:
    run = {**CPNA, "scenario": "CPLA", "v_impact_kmh": 0.0, "warning_ttc_s": 2.0, "lighting": "day"}
    assert {cell.function for cell in measurements([run], CELLS)} == set(Function)
    assert {cell.function for cell in measurements([{**run, "function": "FCW"}], CELLS)} == {Function.FCW}


def test_robustness_runs_name_their_condition() -> None:
    protocol = EuroNcap2026()
    cells = (*protocol.cells("CPNA"), *protocol.robustness_cells("CPNA"))
    found = measurements([{**CPNA, "condition": "Speed: target +3 km/h", "lighting": "day"}], cells)
    assert [cell.layer for cell in found] == [Layer.ROBUSTNESS]


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"scenario": "CPXX"}, "no scenario 'CPXX'; it has: "),
        ({"scenario": None}, "column 'scenario' is missing"),
        ({"v_test_kmh": 15.0}, "tests CPNA at 10, 20, 30, 40, 50, 60 km/h"),
        ({"v_test_kmh": "fast"}, "'v_test_kmh' is 'fast'; give a number"),
        ({"impact_location_percent": 33.0}, "the protocol's cells there are: CPNA AEB at 60 km/h, 90 %"),
        ({"v_impact_kmh": float("nan")}, "'v_impact_kmh' is nan"),
        ({"v_impact_kmh": -1.0}, "impact speed -1.0"),
        ({"condition": "rain"}, "the protocol's cells there are"),
    ],
)
def test_a_run_that_does_not_fit_is_named(changed: dict[str, object], message: str) -> None:
    with pytest.raises(ProtocolError) as caught:
        measurements([{**CPNA, **changed}], CELLS)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_2023_has_the_steps_of_five() -> None:
    found = measurements([{**CPNA, "v_test_kmh": 15.0, "v_impact_kmh": 3.0}], EuroNcap2023().cells())
    assessment = EuroNcap2023().assess(found)
    assert [(t.won, t.most) for t in assessment.totals if t.name in ("CPNA", "together")] == [(0, 1), (0, 1)]
    assert any("no points are given" in note for note in assessment.notes)


@pytest.mark.parametrize("name", PROTOCOLS)
def test_every_protocol_scores_its_own_grid(name: str) -> None:
    protocol = named_protocol(name)
    good = Measurement(0.0, 3.0, 25.0, warning_lead_s=0.5, added_decel_mps2=0.0)
    runs = dict.fromkeys(protocol.cells(), good)
    assessment = protocol.assess(runs)
    assert assessment.title == protocol.title
    assert set(protocol.unknown) <= set(assessment.notes)
    assert len(runs) == len(protocol.cells())
    for total in assessment.totals:
        assert 0.0 < total.won <= total.most


def test_an_unknown_protocol_is_named() -> None:
    with pytest.raises(ProtocolError, match="unknown protocol '2020'; use one of: 2026, 2023, paper, r152"):
        named_protocol("2020")


def test_a_target_that_is_touched_at_its_own_speed_is_touched() -> None:
    """0 stands for no contact; a target that is as fast or faster than the ego is hit all the same."""
    run = {**CPNA, "scenario": "CPLA", "function": "FCW", "lighting": "day", "v_impact_kmh": 5.0}
    for target in (5.0, 6.0):
        (measured,) = measurements([{**run, "target_speed_at_contact_kmh": target}], CELLS).values()
        assert measured.impact_speed_kmh == 0.01
        assert not measured.avoided


def test_a_run_that_was_cut_off_is_invalid() -> None:
    run = {**CPNA, "lighting": "day", "v_impact_kmh": 0.0}
    (measured,) = measurements([{**run, "end_reason": "time_limit"}], CELLS).values()
    assert measured.invalid == "cut off by the time limit: nothing was decided until then"
    assert not measured.avoided
    (early,) = measurements([{**run, "end_reason": "not_begun"}], CELLS).values()
    assert early.invalid == "ended by the scenario's stop trigger before any event of the target began"
    (stopped,) = measurements([{**run, "end_reason": "stopped"}], CELLS).values()
    assert stopped.avoided


@pytest.mark.parametrize(
    ("value", "failed"), [(True, True), ("true", True), (False, False), (None, False), ("", False)]
)
def test_a_false_activation_is_no_avoidance(value: object, failed: bool) -> None:
    run = {**CPNA, "lighting": "day", "v_impact_kmh": 0.0, "false_activation": value}
    (measured,) = measurements([run], CELLS).values()
    assert measured.false_activation is failed
    assert measured.avoided is not failed


def test_a_cell_with_one_invalid_run_is_invalid() -> None:
    """The laboratory may draw either of the two approaches."""
    crossing = {"scenario": "CCCscp", "v_test_kmh": 40.0, "target_speed_kmh": 40.0, "v_impact_kmh": 0.0}
    (cell,) = measurements([crossing, crossing], CELLS)
    found = measurements([crossing, crossing], CELLS, lambda run, _: "off" if run == 1 else "")
    assert found == {cell: Measurement(0.0, None, 40.0, "off")}


def test_a_run_may_be_valid_for_one_of_the_cells_that_it_fits() -> None:
    """It names no impact location: only where it meets the target does it count."""
    anywhere = {"scenario": "CPNA", "v_test_kmh": 60.0, "lighting": "day", "v_impact_kmh": 0.0}
    found = measurements([anywhere], CELLS, lambda _, cell: "" if cell.impact_percent == 75.0 else "off")
    assert len(found) == 5
    assert [cell.impact_percent for cell, run in found.items() if not run.invalid] == [75.0]
