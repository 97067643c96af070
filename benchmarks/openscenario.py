"""Euro NCAP scenarios without braking: time per run, and agreement with reference runs of esmini.

    python -m benchmarks.openscenario [--all]

Times are processor time, reading the scenario included. The peer, measured in the same process, is
highway-env's bare stepping of one vehicle, as often and as long. With `--all` every variation of every file
is run, not only those with a reference. Needs the scenario and reference files beside the project
(`../shared/ncap`).
"""

from __future__ import annotations

import argparse
import csv
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from scenarios.openscenario import BrakeAt, Engine, OpenScenarioError, Run, Variation, expand, load

SHARED = Path(__file__).parents[1].parent / "shared" / "ncap"
LIBRARY = SHARED / "scenarios" / "OpenSCENARIO" / "NCAP"

ESMINI_S = 0.085
"""Processor time of one run of esmini 3.6.0, headless, 10 ms steps (730 runs in 31 s on two cores)."""

STEP_S, EGO_WIDTH_M = 0.01, 1.815
"""Step of the reference, and width of the ego of these files."""

LIMITS = {
    "contact time (s)": STEP_S + 0.001,
    "ego speed (km/h)": 0.05,
    "target speed (km/h)": 0.05,
    "impact location (%)": 0.4,
    "target start (s)": 2 * STEP_S + 0.001,
    "target steady (s)": 2 * STEP_S + 0.001,
}
"""One step of the reference (two for its targets, which know their master a step late), and its rounding.

What the target walks in one step is added to that of the impact location."""


def timed(variation: Variation) -> tuple[Run, float]:
    """A run and its processor time, reading included."""
    start = time.process_time()
    run = Engine(load(variation.path, variation.parameters)).run()
    return run, time.process_time() - start


def differences(run: Run, row: dict[str, str]) -> Iterator[tuple[str, float]]:
    """Ours minus the reference, by quantity; infinite where only one of the two has a value."""
    pairs = (
        ("contact time (s)", run.contact_time_s, row["t_contact"]),
        ("ego speed (km/h)", run.ego_speed_at_contact_kmh, row["v_ego_kph"]),
        ("target speed (km/h)", run.target_speed_at_contact_kmh, row["v_tgt_kph"]),
        ("impact location (%)", run.impact_location_percent, row["box_centre_pct"]),
        ("target start (s)", run.target_start_time_s, row["t_tgt_start"]),
        ("target steady (s)", run.target_steady_time_s, row["t_tgt_steady"]),
    )
    for name, ours, text in pairs:
        if ours is not None and text:
            yield name, ours - float(text)
        elif ours is not None or text:
            yield name, float("inf")


def peer_s(simulated_s: float) -> float:
    """Processor time of highway-env for stepping one vehicle as long, at 10 ms."""
    from highway_env.road.road import Road, RoadNetwork
    from highway_env.vehicle.behavior import IDMVehicle

    road = Road(RoadNetwork.straight_road_network(1, length=1000))
    vehicle = IDMVehicle(road, [0.0, 0.0], speed=13.9, target_lane_index=("0", "1", 0), target_speed=13.9)
    road.vehicles.append(vehicle)
    start = time.process_time()
    for step in range(round(simulated_s / 0.01)):
        if step % 5 == 0:
            road.act()
        road.step(0.01)
    return time.process_time() - start


def unbraked() -> None:
    """Every run with a reference: time and differences."""
    with (SHARED / "oracle" / "no_braking_summary.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    variations = {row["tag"]: expand(LIBRARY / row["file"])[int(row["perm"])] for row in rows}
    timed(next(iter(variations.values())))  # warm up: imports
    times: list[float] = []
    simulated = 0.0
    worst: Counter[str] = Counter()
    outside: list[tuple[str, str, float]] = []
    for row in rows:
        run, seconds = timed(variations[row["tag"]])
        times.append(seconds)
        simulated += run.end_time_s
        for name, difference in differences(run, row):
            worst[name] = max(worst[name], abs(difference))  # type: ignore[assignment]
            limit = LIMITS[name]
            if name == "impact location (%)":
                limit += 100.0 * STEP_S * abs(float(row["v_tgt_kph"])) / 3.6 / EGO_WIDTH_M
            if abs(difference) > limit:
                outside.append((row["tag"], name, difference))
    mean = statistics.mean(times)
    print(f"{len(rows)} unbraked runs with a reference, {simulated:.0f} s simulated, processor time per run:")
    print(f"  mean {1e3 * mean:.1f} ms, median {1e3 * statistics.median(times):.1f} ms")
    print(f"  / esmini's {1e3 * ESMINI_S:.0f} ms   {mean / ESMINI_S:.2f}")
    print(f"  / highway-env     {sum(times) / peer_s(simulated):.2f}    (bare stepping, same process)")
    print("greatest difference from the reference, limit, runs outside:")
    for name, limit in LIMITS.items():
        count = sum(quantity == name for _, quantity, _ in outside)
        print(f"  {name:<22}{worst[name]:8.4f}  {limit:5.2f}  {count:4d}")
    for tag, name, difference in outside:
        print(f"    {tag:<28}{name:<22}{difference:+.3f}")


def braked() -> None:
    """Runs with prescribed braking against their reference and the closed form."""
    with (SHARED / "oracle" / "braking_summary.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    print("braked runs: impact speed (km/h) of ours, the reference, the closed form")
    for row in rows:
        path = LIBRARY / "AEB_VRU_2023" / "NCAP_AEB_VRU_CPNA_2023.xosc"
        definition = load(path, {"Ego_speed_kph": row["v"], "Overlap": row["overlap"]})
        contact_s = Engine(definition).run().contact_time_s or 0.0
        run = Engine(definition, BrakeAt(contact_s - float(row["ttc"]), float(row["a"]))).run()
        v, a, ttc = float(row["v"]) / 3.6, float(row["a"]), float(row["ttc"])
        exact = 3.6 * max(v * v - 2 * a * v * ttc, 0.0) ** 0.5
        ours = run.ego_speed_at_contact_kmh or 0.0
        print(f"  {row['tag']:<32}{ours:7.2f}{float(row['v_impact_kph']):7.2f}{exact:7.2f}")


def everything() -> None:
    """Every variation of every file."""
    files = sorted(LIBRARY.rglob("Variations/**/*.xosc"))
    times: list[float] = []
    contacts = failures = 0
    for file in files:
        for variation in expand(file):
            try:
                run, seconds = timed(variation)
            except OpenScenarioError as error:
                failures += 1
                print(f"  {variation.name}: {error}")
                continue
            times.append(seconds)
            contacts += run.contact_time_s is not None and run.stopped
    print(f"{len(files)} variation files, {len(times) + failures} runs, {failures} failed")
    print(f"  {contacts} end by their stop trigger after a contact")
    print(f"  mean {1e3 * statistics.mean(times):.1f} ms, median {1e3 * statistics.median(times):.1f} ms")


def main() -> int:
    """Print everything."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--all", action="store_true", help="also run every variation of every file")
    options = parser.parse_args()
    if not LIBRARY.is_dir():
        print(f"{LIBRARY}: no scenario files, nothing is compared")
        return 0
    unbraked()
    braked()
    if options.all:
        everything()
    return 0


if __name__ == "__main__":
    sys.exit(main())
