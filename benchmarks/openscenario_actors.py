"""Many entities in one scenario: processor time per simulated second, by their number and the road's length.

    python -m benchmarks.openscenario_actors [--seconds 5]

Writes small scenarios on a curved road of four lanes and runs them at 10 ms steps: entities that follow
their speeds, that keep a distance (LongitudinalDistanceAction within limits), and that are driven by the
Intelligent Driver Model. A number below 1 is faster than real time. The sentences below the table say whether
200 entities run in real time, how the cost grows from 50 to 200 (4 is linear), and what a road of 5 km costs
against one of 500 m; the exit status is 1 if one of them does not hold.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

from scenarios.openscenario import Engine, load

COUNTS = (1, 50, 100, 200)
KINDS = ("speed", "distance", "driver")

LINEAR, SAME_ROAD = 1.25, 1.25
"""What measuring may add: to a growth that is linear, and to a cost that is the same."""

VEHICLE = (
    '<Vehicle name="car" vehicleCategory="car"><BoundingBox><Center x="1.5" y="0" z="0.8"/>'
    '<Dimensions length="4" width="1.8" height="1.6"/></BoundingBox>'
    '<Performance maxSpeed="70" maxAcceleration="5" maxDeceleration="10"/><Axles>'
    '<RearAxle maxSteering="0" wheelDiameter="0.6" trackWidth="1.5" positionX="0" positionZ="0.3"/>'
    "</Axles></Vehicle>"
)
DRIVER = (
    '<ObjectController><Controller name="IDM"><Properties><Property name="timeGap" value="1.2"/>'
    "</Properties></Controller></ObjectController>"
)
ACTIVATE = (
    "<PrivateAction><ControllerAction><ActivateControllerAction longitudinal='true' lateral='false'/>"
    "</ControllerAction></PrivateAction>"
)


def write_road(path: Path, length_m: float) -> None:
    """A left-hand bend of 2 km radius with four lanes in one direction."""
    lanes = "".join(
        f'<lane id="-{k}" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
        for k in range(1, 5)
    )
    path.write_text(
        '<OpenDRIVE><header revMajor="1" revMinor="6"/>'
        f'<road id="1" junction="-1" length="{length_m}"><planView>'
        f'<geometry s="0" x="0" y="0" hdg="0" length="{length_m}"><arc curvature="0.0005"/></geometry>'
        "</planView>"
        '<lanes><laneSection s="0"><center><lane id="0" type="none"/></center>'
        f"<right>{lanes}</right></laneSection></lanes></road></OpenDRIVE>",
        encoding="utf-8",
    )


def write_scenario(path: Path, road: Path, kind: str, count: int, spacing_m: float) -> None:
    """Entities in columns on four lanes, each behind the one before it."""
    entities: list[str] = []
    init: list[str] = []
    for number in range(count):
        row, lane = divmod(number, 4)
        name, speed = f"car{number}", 25.0 - 0.5 * (number % 3)
        controller = DRIVER if kind == "driver" and number else ""
        entities.append(f'<ScenarioObject name="{name}">{VEHICLE}{controller}</ScenarioObject>')
        actions = (
            "<PrivateAction><TeleportAction><Position>"
            f'<LanePosition roadId="1" laneId="-{lane + 1}" s="{10.0 + spacing_m * row}"/>'
            "</Position></TeleportAction></PrivateAction><PrivateAction><LongitudinalAction><SpeedAction>"
            '<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>'
            f'<SpeedActionTarget><AbsoluteTargetSpeed value="{speed}"/></SpeedActionTarget>'
            "</SpeedAction></LongitudinalAction></PrivateAction>"
        )
        if kind == "distance" and number + 4 < count:
            actions += (
                "<PrivateAction><LongitudinalAction><LongitudinalDistanceAction "
                f'entityRef="car{number + 4}" distance="20" freespace="true" continuous="true">'
                '<DynamicConstraints maxAcceleration="2" maxDeceleration="4" maxSpeed="40"/>'
                "</LongitudinalDistanceAction></LongitudinalAction></PrivateAction>"
            )
        if controller:
            actions += ACTIVATE
        init.append(f'<Private entityRef="{name}">{actions}</Private>')
    path.write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="" '
        f'description=""/><CatalogLocations/><RoadNetwork><LogicFile filepath="{road}"/></RoadNetwork>'
        f"<Entities>{''.join(entities)}</Entities><Storyboard><Init><Actions>{''.join(init)}</Actions></Init>"
        "<StopTrigger/></Storyboard></OpenSCENARIO>",
        encoding="utf-8",
    )


def per_second(folder: Path, kind: str, count: int, road_m: float, seconds: float) -> tuple[float, float]:
    """Processor time of the beginning, and of a simulated second."""
    road, scenario = folder / f"road_{road_m:.0f}.xodr", folder / f"{kind}_{count}.xosc"
    if not road.is_file():
        write_road(road, road_m)
    write_scenario(scenario, road, kind, count, 40.0)
    definition = load(scenario)
    start = time.process_time()
    engine = Engine(definition, ego="car0")
    begun = time.process_time()
    engine.run(seconds)
    return begun - start, (time.process_time() - begun) / seconds


def main() -> int:
    """Print the table and what it says."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=5.0, help="simulated time of a run (default 5)")
    seconds: float = parser.parse_args().seconds
    held = True
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        per_second(folder, "speed", 1, 500.0, 0.5)  # warm up: imports
        print("processor seconds per simulated second (and to begin), road of 5 km")
        print(f"{'entities':<10}" + "".join(f"{kind:>18}" for kind in KINDS))
        costs: dict[tuple[str, int], float] = {}
        for count in COUNTS:
            cells: list[str] = []
            for kind in KINDS:
                begin, costs[kind, count] = per_second(folder, kind, count, 5000.0, seconds)
                cells.append(f"{costs[kind, count]:9.3f} ({begin:5.2f})")
            print(f"{count:<10}" + "".join(f"{cell:>18}" for cell in cells))
        for kind in KINDS:
            # the two lengths take turns, so that whatever else the machine does falls on both
            ratios: list[float] = []
            for _ in range(3):
                long = per_second(folder, kind, 8, 5000.0, seconds)[1]
                ratios.append(long / per_second(folder, kind, 8, 500.0, seconds)[1])
            road = sorted(ratios)[1]
            growth, fastest = costs[kind, 200] / costs[kind, 50], costs[kind, 200]
            good = fastest < 1.0 and growth < 4.0 * LINEAR and road < SAME_ROAD
            held &= good
            print(
                f"{kind}: 200 entities take {fastest:.2f} of real time, 50 to 200 costs {growth:.2f} times, "
                f"a road of 5 km {road:.2f} times one of 500 m: {'holds' if good else 'does NOT hold'}"
            )
    return 0 if held else 1


if __name__ == "__main__":
    sys.exit(main())
