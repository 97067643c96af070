"""Time of making data sets: 1,000 frames in at most 60 s on 2 cores is the goal.

    python -m benchmarks.lidar_datasets [--frames 200] [--sensor hdl32] [--from scenes]

Frames are made in one process, and the processor time of 1,000 on two cores is reckoned from it; exits with 1
where the goal is missed.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from evaluation.cli.lidar.dataset.make import parse_composer, parse_sensor, parse_streets
from evaluation.studies.datasets.layouts import LAYOUTS
from evaluation.studies.datasets.make import Recipe, make_dataset

GOAL_S, FRAMES, CORES = 60.0, 1000, 2


def main() -> int:
    """Make a data set of each layout."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=200)
    parser.add_argument("--sensor", default="hdl32")
    parser.add_argument("--from", dest="source", choices=("scenes", "crops"), default="scenes")
    arguments = parser.parse_args()
    config = parse_sensor(arguments.sensor, None)
    maker = parse_streets(config, None, 1) if arguments.source == "scenes" else parse_composer(config, 1)
    missed = 0
    for layout in LAYOUTS:
        with tempfile.TemporaryDirectory() as folder:
            begun = time.process_time()
            recipe = Recipe(maker, layout, arguments.frames, 1, 1, {})
            make_dataset(recipe, Path(folder) / "data")
            spent_s = time.process_time() - begun
        whole_s = spent_s / arguments.frames * FRAMES / CORES
        missed += whole_s > GOAL_S
        print(
            f"{arguments.source}, {arguments.sensor}, {layout}: {1e3 * spent_s / arguments.frames:.1f} ms of "
            f"processor time a frame, {FRAMES} frames on {CORES} cores {whole_s:.0f} s (goal {GOAL_S:g}); "
            f"load {os.getloadavg()[0]:.1f}"
        )
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
