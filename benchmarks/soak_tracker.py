"""Memory of the tracker over a long run with births and deaths.

    python -m benchmarks.soak_tracker [--updates N] [--objects K]

Objects walk through a square; each lives for a random time and is replaced elsewhere, so tracks are born and
die all the time. The resident memory is read ten times over the run; the last three quarters may not grow by
more than 1 MB. Exit code 1 if they do.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

import numpy as np

from smartmot import Boxes, Detections, Tracker

PAGE_BYTES = 4096
ALLOWED_MB = 1.0


def resident_mb() -> float:
    """Resident memory of this process (Linux)."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * PAGE_BYTES / 2**20


class Crowd:
    """Objects that appear and vanish.

    Args:
        count: How many there are at any time.
    """

    def __init__(self, count: int) -> None:
        self._rng = np.random.default_rng(0)
        self._count = count
        self._center = self._rng.uniform(-50, 50, (count, 2))
        self._velocity = self._rng.normal(0, 1.5, (count, 2))
        self._left_s = self._rng.exponential(5.0, count)

    def frame(self, stamp_s: float, dt_s: float) -> Detections:
        """What a detector with 5 % misses and 0.05 m of noise sees dt_s later."""
        self._center += self._velocity * dt_s
        self._left_s -= dt_s
        gone = self._left_s < 0.0
        n = int(gone.sum())
        self._center[gone] = self._rng.uniform(-50, 50, (n, 2))
        self._left_s[gone] = self._rng.exponential(5.0, n)
        seen = self._rng.random(self._count) > 0.05
        m = int(seen.sum())
        center = self._center[seen] + self._rng.normal(0, 0.05, (m, 2))
        boxes = Boxes(center, np.full((m, 2), 0.6), np.zeros(m))
        return Detections(stamp_s, boxes, np.full(m, 0.9), np.full(m, "pedestrian"))


def main() -> int:
    """Run, print memory on the way, and judge."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--updates", type=int, default=1_000_000)
    parser.add_argument("--objects", type=int, default=5)
    arguments = parser.parse_args()
    tracker, crowd = Tracker(), Crowd(arguments.objects)
    every = max(arguments.updates // 10, 1)
    memory: list[float] = []
    start = time.perf_counter()
    for k in range(1, arguments.updates + 1):
        tracks = tracker.update(crowd.frame(0.1 * k, 0.1))
        if k % every == 0:
            memory.append(resident_mb())
            print(
                f"{k:>9} updates  {memory[-1]:7.2f} MB  {tracker.state.next_id - 1:>9} tracks so far  "
                f"{len(tracks):>3} alive  {(time.perf_counter() - start) / k * 1e3:.3f} ms each",
                flush=True,
            )
    settled = memory[len(memory) // 4 :]
    growth = max(settled) - settled[0]
    print(f"growth after the first quarter: {growth:.2f} MB (allowed: {ALLOWED_MB:g} MB)")
    return int(growth > ALLOWED_MB)


if __name__ == "__main__":
    sys.exit(main())
