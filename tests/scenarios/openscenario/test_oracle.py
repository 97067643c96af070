"""The published Euro NCAP scenarios against all reference runs of esmini 3.6.0 (10 ms steps; braking 5 ms).

esmini integrates by whole steps, notices a contact at the end of one, and its synchronised targets know their
master one step late; ours are closed forms, and target and master arrive at the same instant, as the standard
asks. So the two agree within one of *its* steps: 10 ms, and what the target walks across the ego's width
meanwhile. What whole steps do is worked out here as well: with esmini's step its value comes out, with ever
finer steps ours.
"""

import csv
import math

import numpy as np
import pytest

from scenarios.openscenario import BrakeAt, Engine, expand, load
from scenarios.openscenario.control import Motion

STEP_S = 0.01
ROUNDED_S = 0.001
"""Times of the reference fall on whole steps, give or take rounding."""
ROUNDED_PERCENT = 0.4
"""Its impact locations are rounded to 0.1 %, its boxes and speeds to millimetres."""
EGO_WIDTH_M = 1.815
FRONT_M = 1.349 + 4.358 / 2
TWO_STEPS = ("2023_CPFA-50_Variation_03",)
"""At 25 km/h the start falls on a step: rounding makes esmini's target two steps late instead of one."""


def rows(ncap, name):
    with (ncap / "oracle" / name).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def number(text):
    return float(text) if text else None


@pytest.fixture(scope="module")
def library(ncap):
    return ncap / "scenarios" / "OpenSCENARIO" / "NCAP"


@pytest.fixture(scope="module")
def pairs(ncap, library):
    """(reference row, our run) of all runs."""
    variations = {}
    found = []
    for row in rows(ncap, "no_braking_summary.csv"):
        if row["file"] not in variations:
            variations[row["file"]] = expand(library / row["file"])
        variation = variations[row["file"]][int(row["perm"])]
        found.append((row, Engine(load(variation.path, variation.parameters)).run()))
    return found


def test_contact_times_and_speeds(pairs):
    assert len(pairs) >= 132
    for row, run in pairs:
        # a sample of the reference is up to one step later than the touch
        assert 0.0 <= float(row["t_contact"]) - run.contact_time_s <= STEP_S + ROUNDED_S, row["tag"]
        assert run.ego_speed_at_contact_kmh == pytest.approx(float(row["v_ego_kph"]), abs=0.05), row["tag"]
        assert run.target_speed_at_contact_kmh == pytest.approx(float(row["v_tgt_kph"]), abs=0.05), row["tag"]


def test_target_times(pairs):
    """One step late by its knowledge of the master, and up to one by sampling."""
    for row, run in pairs:
        start, steady = number(row["t_tgt_start"]), number(row["t_tgt_steady"])
        assert (run.target_start_time_s is None) == (start is None), row["tag"]
        if start is not None:
            assert run.target_start_time_s == pytest.approx(start, abs=2 * STEP_S + ROUNDED_S), row["tag"]
        assert run.target_steady_time_s == pytest.approx(steady, abs=2 * STEP_S + ROUNDED_S), row["tag"]


def test_impact_locations(pairs):
    """Within what the target walks in one step of the reference."""
    for row, run in pairs:
        steps = 2 if row["tag"] in TWO_STEPS else 1
        walked = 100.0 * steps * STEP_S * abs(float(row["v_tgt_kph"])) / 3.6 / EGO_WIDTH_M
        allowed = walked + ROUNDED_PERCENT
        assert run.impact_location_percent == pytest.approx(float(row["box_centre_pct"]), abs=allowed), row[
            "tag"
        ]


def test_impact_locations_where_the_reference_takes_them(pairs):
    """What the difference consists of: its sample after the touch, of a target that is one step late."""
    checked = 0
    for row, run in pairs:
        if float(row["speed"]) == 25.0 or number(row["t_tgt_start"]) is None:
            continue
        after = int(np.searchsorted(run.time_s, run.contact_time_s))
        k = [after - 1, after]
        dx, dy = run.x_m[k, 1] - run.x_m[k, 0], run.y_m[k, 1] - run.y_m[k, 0]
        left_m = dy * np.cos(run.yaw_rad[k, 0]) - dx * np.sin(run.yaw_rad[k, 0])
        walks_mps = (left_m[1] - left_m[0]) / (run.time_s[after] - run.time_s[after - 1])
        later_s = float(row["t_contact"]) - STEP_S - run.contact_time_s
        there = run.impact_location_percent + 100.0 * walks_mps * later_s / EGO_WIDTH_M
        assert there == pytest.approx(float(row["box_centre_pct"]), abs=0.1), row["tag"]
        checked += 1
    assert checked >= 35


def test_trajectories(ncap, library):
    """The target within 3 mm of where it was one step of the reference before; the ego is equal."""
    for path in sorted((ncap / "oracle" / "trajectories").glob("*.csv")):
        table = np.genfromtxt(path, delimiter=",", names=True)
        family = path.stem.removeprefix("2023_").removesuffix("_00")
        variation = expand(library / "AEB_VRU_2023" / "Variations" / f"NCAP_AEB_VRU_{family}_2023.xosc")[0]
        run = Engine(load(variation.path, variation.parameters)).run()
        n = min(len(table), len(run.time_s) - 1)
        assert n > 600
        for name, column in (("Ego_x", run.x_m), ("Ego_y", run.y_m), ("Ego_v", run.speed_mps)):
            np.testing.assert_allclose(table[name][:n], column[:n, 0], atol=2e-6)
        np.testing.assert_allclose(table["VRU_x"][1:n], run.x_m[: n - 1, 1], atol=2e-6)
        np.testing.assert_allclose(table["VRU_y"][1:n], run.y_m[: n - 1, 1], atol=3e-3)
        turn = np.sin(0.5 * (table["VRU_h"][:n] - run.yaw_rad[:n, 1]))
        np.testing.assert_allclose(turn, 0.0, atol=2e-6)


def stepped_crossing(speed_kmh, step_s):
    """Box centre at the first step of overlap in CPFA-50, if the target sees the ego one step late."""
    v, final = speed_kmh / 3.6, 8 / 3.6
    way, steady, gap = 6.06, 4.5, 6 * v - FRONT_M - 0.25
    left, moving, k = way, False, 0
    while gap - v * step_s * k > 1e-9:
        seen = (gap - v * step_s * max(k - 1, 0)) / v
        rest_m, rest_s = left - steady, seen - steady / final
        if rest_m < 1e-6 or rest_s < 1e-6:
            speed = final
        else:
            moving = moving or rest_s < 2 * rest_m / final
            speed = max(2 * rest_m / rest_s - final, 0.0) if moving else 0.0
        left -= speed * step_s
        k += 1
    return 50 + 100 * (6.0 - (way - left)) / EGO_WIDTH_M


def test_whole_steps_explain_the_impact_location(ncap, library):
    """esmini's values come from its step; without it they would be ours."""
    checked = 0
    for row in rows(ncap, "no_braking_summary.csv"):
        if row["scenario"] != "CPFA-50":
            continue
        speed = float(row["speed"])
        variation = expand(library / row["file"])[int(row["perm"])]
        fine = stepped_crossing(speed, 1e-4)
        run = Engine(load(variation.path, variation.parameters), until_contact=True).run()
        # both arrive at once, whatever the speed: 6.06 m of way to a line that is 6 m beside the start
        assert run.impact_location_percent == pytest.approx(50 + 100 * (6.0 - 6.06) / EGO_WIDTH_M, abs=1e-4)
        if speed in (10.0, 40.0, 60.0):
            assert run.impact_location_percent == pytest.approx(fine, abs=0.05)
        if speed != 25.0:  # where a touch falls on a step, rounding decides between two steps
            assert stepped_crossing(speed, STEP_S) == pytest.approx(float(row["box_centre_pct"]), abs=0.06)
            checked += 1
    assert checked >= 10


def stepped_braking(speed_kmh, ttc_s, decel, step_s):
    """Impact speed by whole steps, speed first (semi-implicit Euler)."""
    v0 = speed_kmh / 3.6
    gap = 6 * v0 - FRONT_M - 0.25
    k = math.ceil((gap / v0 - ttc_s) / step_s - 1e-9)
    x, v, t = v0 * k * step_s, v0, k * step_s
    while x < gap and v > 0:
        v = max(v - decel * step_s, 0.0)
        x += v * step_s
        t += step_s
    return 3.6 * v


class SteppedBrake:
    """The ego of the reference: from the first step of 5 ms on it is set to a lower speed in every step.

    Args:
        time_s: when to brake.
        decel_mps2: how much lower a second later.
    """

    def __init__(self, time_s, decel_mps2, step_s=0.005):
        self.begin_s = math.ceil(time_s / step_s - 1e-9) * step_s
        self.change_mps, self.step_s, self.speed_mps = decel_mps2 * step_s, step_s, 0.0

    commands_from_s = 0.0

    def take_over(self, time_s, path, station_m, speed_mps):
        self.speed_mps = speed_mps

    def _at(self, time_s):
        """Way and speed."""
        way, braking = self.speed_mps * min(time_s, self.begin_s), max(time_s - self.begin_s, 0.0)
        whole = math.floor(braking / self.step_s + 1e-9)
        speeds = [max(self.speed_mps - self.change_mps * (k + 1), 0.0) for k in range(whole + 1)]
        rest = max(braking - whole * self.step_s, 0.0)
        speed = speeds[-1] if braking > 0.0 else self.speed_mps
        return way + sum(speeds[:-1]) * self.step_s + speeds[-1] * rest, speed

    def motion(self, time_s, duration_s):
        (before, _), (after, speed) = self._at(time_s), self._at(time_s + duration_s)
        return Motion(after - before, speed)

    def advance(self, time_s, duration_s):
        """Everything follows from the time."""


def test_braked_runs_with_the_references_ego(ncap, library):
    """The same ego in our engine: impact speeds within 0.1 km/h."""
    hits = 0
    for row in rows(ncap, "braking_summary.csv"):
        parameters = {"Ego_speed_kph": row["v"], "Overlap": row["overlap"]}
        definition = load(library / "AEB_VRU_2023" / "NCAP_AEB_VRU_CPNA_2023.xosc", parameters)
        brake_s = Engine(definition).run().contact_time_s - float(row["ttc"])
        run = Engine(definition, SteppedBrake(brake_s, float(row["a"]))).run()
        assert (run.contact_time_s is not None) == (row["collided"] == "1"), row["tag"]
        if run.contact_time_s is not None:
            hits += 1
            assert run.ego_speed_at_contact_kmh == pytest.approx(float(row["v_impact_kph"]), abs=0.1), row[
                "tag"
            ]
    assert hits >= 2


def test_braked_runs(ncap, library):
    """Our brake is not stepped: the impact speed is the closed form sqrt(v^2 - 2 a v TTC).

    Steps of 5 ms, as those of the reference, give up to 0.6 km/h less where little speed is left.
    """
    hits = 0
    for row in rows(ncap, "braking_summary.csv"):
        v, ttc, decel = float(row["v"]), float(row["ttc"]), float(row["a"])
        definition = load(
            library / "AEB_VRU_2023" / "NCAP_AEB_VRU_CPNA_2023.xosc",
            {"Ego_speed_kph": row["v"], "Overlap": row["overlap"]},
        )
        free = Engine(definition).run()
        run = Engine(definition, BrakeAt(free.contact_time_s - ttc, decel)).run()
        assert (run.contact_time_s is not None) == (row["collided"] == "1"), row["tag"]
        assert run.end_time_s == pytest.approx(float(row["t_end"]), abs=0.03)
        # the target walks on, also where esmini stops it because the ego brakes before the steady state
        assert run.speed_mps[-1, 1] == pytest.approx(5 / 3.6)
        if ttc < 2.1:
            assert run.speed_mps[-1, 1] == pytest.approx(float(row["vru_v_at_end"]), abs=1e-3)
        if run.contact_time_s is not None:
            hits += 1
            exact = 3.6 * math.sqrt((v / 3.6) ** 2 - 2 * decel * v / 3.6 * ttc)
            assert run.ego_speed_at_contact_kmh == pytest.approx(exact, abs=1e-4)
            assert stepped_braking(v, ttc, decel, 0.005) == pytest.approx(
                float(row["v_impact_kph"]), abs=0.01
            )
            assert stepped_braking(v, ttc, decel, 1e-5) == pytest.approx(exact, abs=0.01)
    assert hits >= 2


def test_all_files_expand(library):
    files = sorted(library.rglob("Variations/**/*.xosc"))
    assert len(files) == 109
    total = 0
    for file in files:
        variations = expand(file)
        total += len(variations)
        assert all(variation.path.is_file() for variation in variations)
        definition = load(variations[-1].path, variations[-1].parameters)
        assert {"Ego"} < {entity.name for entity in definition.entities}
    assert total > 1000


def test_one_run_of_every_base_file(library):
    """Each ends by its own stop trigger, after the ego has met its target at the test's speed."""
    files = sorted(library.glob("*/*.xosc"))
    files = [file for file in files if file.parent.name != "Catalogs"]
    assert len(files) == 23
    for file in files:
        run = Engine(load(file)).run()
        assert run.stopped, file.name
        assert run.contact_entity == run.target, file.name
        assert abs(run.speed_mps[:, 0]).max() * 3.6 == pytest.approx(abs(run.ego_speed_at_contact_kmh)), (
            file.name
        )
