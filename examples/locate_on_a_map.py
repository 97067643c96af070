"""Points on a map: their lanes, road coordinates and heights, and the way ahead.

    python examples/locate_on_a_map.py [FILE.xodr]

Positions are in the map frame: metres, x east, y north.
"""

import sys

import numpy as np

import smartmot


def main(source: str = "urban_intersection") -> None:
    """Locate points along a lane and beside it, and follow the lane."""
    network = smartmot.load_map(source)
    lanes = network.lanes
    print(f"{source}: {len(lanes)} lanes on {len(network.roads)} roads")

    lane = int(np.flatnonzero(lanes.lane_type == "driving")[0])
    stations_m = np.linspace(lanes.s_start_m[lane], lanes.s_end_m[lane], 5)
    points_m = np.column_stack(network.center_line(lane, stations_m)[:2])
    hits = network.locate(points_m)  # any number of points at once
    for point, hit, s_m, t_m in zip(hits.point, hits.lane, hits.s_m, hits.t_m, strict=True):
        x_m, y_m = points_m[point]
        road, _, lane_id = lanes.key[hit]
        height_m = network.road_point(road, s_m, t_m).z_m
        print(
            f"x {x_m:7.2f} m  y {y_m:7.2f} m: road {road}, lane {lane_id} ({lanes.lane_type[hit]}), "
            f"s {s_m:.2f} m, t {t_m:.2f} m, height {float(height_m):.2f} m"
        )

    nearest = network.nearest_lane(points_m[:1] + np.array([0.0, 40.0]))
    road, _, lane_id = lanes.key[nearest.lane[0]]
    print(f"40 m north of the first: {nearest.distance_m[0]:.2f} m from road {road}, lane {lane_id}")

    route = smartmot.route_ahead(network, lane, s_m=float(lanes.s_start_m[lane]), ahead_m=200.0)
    print("roads ahead:", " -> ".join(lanes.key[k].road_id for k in route.lanes))


if __name__ == "__main__":
    main(*sys.argv[1:2])
