"""Damages maps at random and looks what loading and querying them does.

    python -m benchmarks.fuzz_opendrive --seconds 600

Every outcome has to be a network whose queries give finite numbers, or a named error. Anything else is
printed with the seed that leads to it, and kept as a file. The test suite runs a short, seeded part of this.
"""

import argparse
import copy
import random
import re
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
from lxml import etree

from opendrive import OpenDriveError, RoadNetwork, load_map, read_map

SHIPPED = sorted((Path(__file__).parents[1] / "scenarios" / "maps").glob("*.xodr"))

_VALUES = (
    "", "x", "nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "1e9", "-1e9", "1e5", "0", "-0.0", "1", "-1",
    "3", "-3", "0.5", "1e-9", "start", "end", "none", "true", "-1000000", "99999999999999999999",
    "\u0663", "1_0",
)  # fmt: skip
_NUMBER = re.compile(rb"\d+(\.\d+)?")


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Return a map with a few things wrong with it: bytes, numbers, attributes or elements."""
    choice = rng.random()
    if choice < 0.15:
        return _damaged_bytes(data, rng)
    if choice < 0.35:
        matches = list(_NUMBER.finditer(data))
        for match in sorted(rng.sample(matches, min(3, len(matches))), key=lambda m: -m.start()):
            data = data[: match.start()] + rng.choice(_VALUES).encode() + data[match.end() :]
        return data
    root = etree.fromstring(data)
    for _ in range(rng.randint(1, 4)):
        _damage_element(rng.choice(list(root.iter(etree.Element))), rng)
    return etree.tostring(root)


def _damaged_bytes(data: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(data))
    match rng.randrange(4):
        case 0:
            return data[:at]
        case 1:
            return data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
        case 2:
            return data[:at] + data[at + rng.randrange(200) :]
        case _:
            return data[:at] + data[max(0, at - rng.randrange(500)) :]


def _damage_element(element: etree._Element, rng: random.Random) -> None:
    parent = element.getparent()
    choice = rng.random()
    if choice < 0.55 and element.attrib:
        element.set(rng.choice([str(name) for name in element.attrib]), rng.choice(_VALUES))
    elif choice < 0.65 and element.attrib:
        del element.attrib[rng.choice(list(element.attrib))]
    elif parent is None:
        element.tag = "OpenDRIVE2" if choice > 0.98 else "OpenDRIVE"
    elif choice < 0.78:
        parent.remove(element)
    elif choice < 0.9:
        parent.insert(rng.randrange(len(parent) + 1), copy.deepcopy(element))
    elif choice < 0.96:
        element.tag = rng.choice(
            ("width", "border", "lane", "arc", "poly3", "spiral", "shape", "speed", "object")
        )
    else:
        random_parent = rng.choice(list(element.getroottree().getroot().iter(etree.Element)))
        random_parent.append(copy.deepcopy(element))


def query(network: RoadNetwork, rng: np.random.Generator) -> None:
    """Ask a network for what users ask for; every number has to be finite.

    Raises:
        AssertionError: a result is not finite.
    """
    low, high = np.array(network.bounds[:2]), np.array(network.bounds[2:])
    assert np.isfinite(network.bounds).all(), "bounds"
    points = rng.uniform(low - 5.0, high + 5.0, (20, 2))
    near, hits = network.nearest_lane(points), network.locate(points)
    for name, value in (*near._asdict().items(), *hits._asdict().items()):
        assert np.isfinite(value).all(), name
    lanes = network.lanes
    for lane in rng.integers(0, len(lanes), 3).tolist() if len(lanes) else ():
        s = np.linspace(lanes.s_start_m[lane], lanes.s_end_m[lane], 5)
        for value in network.center_line(lane, s):
            assert np.isfinite(value).all(), "center_line"
        assert np.isfinite(network.lane_width(lane, s)).all(), "lane_width"
        assert np.isfinite(network.borders(lane, s)).all(), "borders"
        network.successors(lane)
        network.predecessors(lane)
        network.speed_limit(lane, float(s[2]))
        network.lane_change(lane, float(s[2]), "left")
    for crosswalk in network.crosswalks:
        assert np.isfinite(crosswalk.polygon).all(), "crosswalk"
    for road_id in network.roads:
        network.signals_of(road_id)
    assert all(warning.message for warning in network.warnings), "warnings"


def outcome(file: Path, seed: int, with_queries: bool = True) -> str:
    """Read a file, or load and query it; return ``loaded`` or the name of the error."""
    try:
        if with_queries:
            query(load_map(file), np.random.default_rng(seed))
        else:
            assert all(warning.message for warning in read_map(file).warnings), "warnings"
    except OpenDriveError as error:
        return type(error).__name__
    return "loaded"


def main() -> None:
    """Damage maps until the time is up; exit with status 1 if anything unexpected happened."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=60.0, help="processor time to spend")
    parser.add_argument("--seed", type=int, default=0, help="first seed")
    parser.add_argument("--keep", type=Path, default=Path("results/fuzz"), help="folder for files that fail")
    parser.add_argument("maps", nargs="*", type=Path, default=SHIPPED, help="maps to damage")
    arguments = parser.parse_args()
    sources = [file.read_bytes() for file in arguments.maps]
    outcomes: Counter[str] = Counter()
    start, seed, slowest_s = time.process_time(), arguments.seed, 0.0
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "damaged.xodr"
        while time.process_time() - start < arguments.seconds:
            data = damaged(sources[seed % len(sources)], random.Random(seed))
            file.write_bytes(data)
            begin = time.process_time()
            try:
                outcomes[outcome(file, seed)] += 1
            except Exception as error:
                outcomes[f"UNEXPECTED {type(error).__name__}"] += 1
                arguments.keep.mkdir(parents=True, exist_ok=True)
                (arguments.keep / f"{seed}.xodr").write_bytes(data)
                print(f"seed {seed}: {type(error).__name__}: {error}")
            slowest_s = max(slowest_s, time.process_time() - begin)
            seed += 1
    for name, count in outcomes.most_common():
        print(f"{count:8d}  {name}")
    print(f"{seed - arguments.seed} maps, the slowest took {slowest_s:.2f} s")
    raise SystemExit(any(name.startswith("UNEXPECTED") for name in outcomes))


if __name__ == "__main__":
    main()
