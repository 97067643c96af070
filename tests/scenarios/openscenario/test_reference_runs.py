"""The shipped crossing with the car of Vector's Euro NCAP files, against esmini's runs of those files.

esmini integrates by whole steps of 10 ms: it notices a contact at the end of one, and its target knows its
master one step late. So times agree within two steps, locations within what the target walks in one.
"""

import csv
from pathlib import Path

import pytest

from scenarios.catalogue.library import DEFINITIONS
from scenarios.openscenario import Engine, load

with (Path(__file__).parents[2] / "data" / "esmini" / "crossings.csv").open(encoding="utf-8") as file:
    ROWS = list(csv.DictReader(file))

STEP_S = 0.01
ROUNDED_S = 0.006
"""Times of the reference are rounded to 10 ms."""
ROUNDED_PERCENT = 0.4
"""Its locations are rounded to 0.1 %, its boxes and speeds to millimetres."""
CAR = {"Ego_width": 1.815, "Ego_length": 4.358, "Ego_center": 1.349}
"""The vehicle under test of those files; metres."""
TARGETS = {
    # catalog entry, box across its way, point that counts, start and steady way before the lane centre, side
    "CPNA": ("adult", 0.5, -0.06, 4.0, 3.0, 1),
    "CPFA": ("adult", 0.5, -0.06, 6.0, 4.5, -1),
    "CPNCO": ("child", 0.298, -0.0405, 4.0, 3.0, 1),
}


@pytest.mark.parametrize(
    "row", ROWS, ids=lambda row: f"{row['scenario']}-{row['impact_percent']}-{row['ego_speed_kmh']}"
)
def test_times_and_locations(row: dict[str, str]) -> None:
    entry, width, reference, offset, steady, near = TARGETS[row["scenario"]]
    speed_kmh, percent = float(row["target_speed_kmh"]), float(row["impact_percent"])
    across = CAR["Ego_width"] * (percent / 100 - 0.5)
    values = CAR | {
        "Ego_speed_kmh": float(row["ego_speed_kmh"]),
        "Target_entry": entry,
        "Target_width": width,
        "Target_reference": reference,
        "Target_speed_kmh": speed_kmh,
        "Target_offset": offset,
        # those files end the acceleration where the steady way begins, whatever the impact location
        "Acceleration_distance": offset + near * across - reference - steady,
        "From_near_side": near,
        "Impact_percent": percent,
    }
    run = Engine(load(DEFINITIONS / "crossing.xosc", values)).run()
    assert run.contact_time_s is not None
    assert run.target_start_time_s is not None
    assert run.target_steady_time_s is not None
    after_start, after_steady = (
        run.contact_time_s - run.target_start_time_s,
        run.contact_time_s - run.target_steady_time_s,
    )
    assert after_start == pytest.approx(float(row["start_to_contact_s"]), abs=2 * STEP_S + ROUNDED_S)
    assert after_steady == pytest.approx(float(row["steady_to_contact_s"]), abs=2 * STEP_S + ROUNDED_S)
    walked_percent = 100.0 * STEP_S * speed_kmh / 3.6 / CAR["Ego_width"]
    assert run.impact_location_percent == pytest.approx(
        float(row["box_center_percent"]), abs=walked_percent + ROUNDED_PERCENT
    )
    assert run.ego_speed_at_contact_kmh == pytest.approx(float(row["ego_speed_kmh"]), abs=0.05)
    assert run.target_speed_at_contact_kmh == pytest.approx(speed_kmh, abs=0.05)


def test_there_are_enough_of_every_kind() -> None:
    assert len(ROWS) >= 20
    assert {row["scenario"] for row in ROWS} == set(TARGETS)
    assert {float(row["impact_percent"]) for row in ROWS} == {25.0, 50.0, 75.0}
