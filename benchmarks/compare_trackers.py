"""HOTA, MOTA and IDF1 of our configurations, norfair and motpy on the same detections, in one run.

    python -m benchmarks.compare_trackers [--kitti DIR] [--argoverse2 DIR] [--peer-python PYTHON]

Data are KITTI's layout with labels, and a CSV folder of Argoverse 2 with a detector at 2 Hz. Centres match
within 2 m; tracks below the mean score with the best MOTA are left out, chosen per category with the labels,
as AB3DMOT's evaluation does, for all trackers alike. `before` is `default` with the thresholds on scores as
they were: 0.6 for every detector, no evidence over time, nothing hidden, no duplicates merged.

norfair (distance of centres, 2 m) and motpy (overlap of axis-aligned boxes), a tracker per category, confirm
at once, let tracks live for 1.25 s as `default` does with cars, and show what has a detection: with their own
defaults, which count frames, most figures are lower. They run in an environment of their own, made from PyPI
in a temporary folder unless --peer-python names one that has them.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.tracking import peer_python
from evaluation.studies.mot.run import score_tracks, track_dataset
from evaluation.studies.mot.score_scale import with_score_scale
from evaluation.studies.mot.tracking import TrackedSequence
from scenarios.recorded.dataset import Dataset, Objects
from scenarios.recorded.formats import read_dataset
from smartmot import PerCategory, TrackerConfig, tracker_config

SHARED = Path(__file__).parents[2] / "shared"
CATEGORIES = ("car", "pedestrian", "cyclist")
NAMED = ("default", "centerpoint", "ab3dmot", "smartmot")

PEER_PROGRAM = r"""
import json, sys
import numpy as np

LIFE_S = 1.25


def norfair(frames, dt):
    import norfair as package

    life = max(2, round(LIFE_S / dt))
    tracker = package.Tracker(
        distance_function="euclidean", distance_threshold=2.0, hit_counter_max=life, initialization_delay=0
    )
    for k, rows in enumerate(frames):
        given = [package.Detection(points=np.array([r[:2]]), data=(k, i)) for i, r in enumerate(rows)]
        for track in tracker.update(given):
            frame, i = track.last_detection.data
            if frame == k:
                yield k, track.id, *rows[i]


def motpy(frames, dt):
    import motpy as package

    tracker = package.MultiObjectTracker(
        dt=dt,
        tracker_kwargs={"max_staleness": max(2, round(LIFE_S / dt))},
        active_tracks_kwargs={"max_staleness": 1},
    )
    numbers = {}
    for k, rows in enumerate(frames):
        boxes = [np.array([x - l / 2, y - w / 2, x + l / 2, y + w / 2]) for x, y, l, w, *_ in rows]
        for track in tracker.step([package.Detection(box=b, score=r[5]) for b, r in zip(boxes, rows)]):
            x0, y0, x1, y1 = map(float, track.box)
            number = numbers.setdefault(track.id, len(numbers) + 1)
            size = max(x1 - x0, 0.1), max(y1 - y0, 0.1)
            yield k, number, (x0 + x1) / 2, (y0 + y1) / 2, *size, 0.0, float(track.score)


given = json.load(sys.stdin)
made = {
    peer.__name__: [list(peer(frames, dt)) for frames, dt in given]
    for peer in (norfair, motpy)
}
json.dump(made, sys.stdout)
"""


def before(config: TrackerConfig) -> TrackerConfig:
    """`default` as it was for one detector: fixed thresholds, one frame decides, all is forgotten alike."""
    return replace(
        config,
        association=replace(config.association, hidden_gate_m=None),
        filter=replace(config.filter, heading="detector"),
        lifecycle=replace(config.lifecycle, rest_max_age_s=None),
        report=replace(config.report, score=PerCategory.grouped(0.0, 0.0, 0.5), mean_score=0.6),
        second_stage_score=0.6,
        score_reference=1.0,
        evidence_memory_s=None,
        merge_duplicates=False,
    )


def ours(data: Dataset) -> dict[str, list[TrackedSequence]]:
    """What our configurations make of the data, with the score scale of the file."""
    configs = {"before": before(tracker_config("default"))} | {name: tracker_config(name) for name in NAMED}
    return {
        name: track_dataset(data, with_score_scale(config, data, "file")) for name, config in configs.items()
    }


def peers(python: str, data: Dataset) -> dict[str, list[TrackedSequence]]:
    """What the peers make of them: a tracker per sequence and category."""
    parts, given = [], []
    for sequence in data.sequences:
        dt_s = float(np.median(np.diff(sequence.stamp_s)))
        for category in CATEGORIES:
            objects = sequence.detections[sequence.detections.category == category]
            table = np.column_stack((objects.center_m, objects.size_m, objects.yaw_rad, objects.score))
            parts.append((sequence, category))
            given.append(([table[rows].tolist() for rows in objects.frame_rows(len(sequence))], dt_s))
    run = subprocess.run(
        [python, "-c", PEER_PROGRAM], input=json.dumps(given), capture_output=True, text=True, check=True
    )
    made: dict[str, list[Any]] = json.loads(run.stdout)
    return {name: _by_sequence(data, parts, rows) for name, rows in made.items()}


def _by_sequence(
    data: Dataset, parts: Iterable[tuple[Any, str]], tables: list[list[list[float]]]
) -> list[TrackedSequence]:
    """Rows of a peer (frame, identity, x, y, length, width, yaw, score) as tracks; identities by category."""
    tracked = []
    for sequence in data.sequences:
        columns = []
        for number, ((of, category), rows) in enumerate(zip(parts, tables, strict=True)):
            if of is sequence and rows:
                columns.append((number, category, np.array(rows, dtype=np.float64)))
        table = np.concatenate([np.zeros((0, 8)), *(rows for _, _, rows in columns)])
        names = [category for _, category, rows in columns for _ in rows]
        offsets = [1_000_000 * number for number, _, rows in columns for _ in rows]
        tracks = Objects.of(
            table[:, 0],
            table[:, 2:4],
            size_m=table[:, 4:6],
            yaw_rad=table[:, 6],
            score=table[:, 7],
            object_id=table[:, 1].astype(np.int64) + np.array(offsets, dtype=np.int64),
            category=np.array(names, dtype=np.str_),
        )
        count = len(tracks)
        tracked.append(
            TrackedSequence(sequence, tracks, np.zeros(count), np.zeros((count, 2)), np.zeros(count))
        )
    return tracked


def main() -> int:
    """Print a table per data set."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kitti", type=Path, default=SHARED / "kitti")
    parser.add_argument("--argoverse2", type=Path, default=SHARED / "argoverse2" / "detections_2hz")
    parser.add_argument("--peer-python", help="interpreter that has norfair and motpy")
    arguments = parser.parse_args()
    folders = {"KITTI": arguments.kitti, "Argoverse 2": arguments.argoverse2}
    there = {name: folder for name, folder in folders.items() if folder.is_dir()}
    for name, folder in folders.items():
        if name not in there:
            print(f"{folder}: no folder, {name} left out")
    if not there:
        return 0
    with tempfile.TemporaryDirectory() as scratch:
        python = arguments.peer_python or peer_python(Path(scratch))
        for name, folder in there.items():
            data = read_dataset(folder)
            print(f"\n{name}: HOTA / MOTA / IDF1")
            print(f"  {'':<14}" + "".join(f"{category:<24}" for category in CATEGORIES))
            for tracker, tracked in (ours(data) | peers(python, data)).items():
                scores = {s.category: s for s in score_tracks(tracked, ["distance"]) if s.sequence == "all"}
                cells = [
                    f"{s.hota:5.1f} /{s.mota:5.1f} /{s.idf1:5.1f}     "
                    for s in (scores[category] for category in CATEGORIES)
                ]
                print(f"  {tracker:<14}" + "".join(cells), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
