"""Open3D's half of `benchmarks.lidar`: runs in an environment with open3d, prints one JSON object.

    PEER_PYTHON lidar_peer.py REQUEST.json

The request names boxes and files of directions; ranges are written beside these.
"""

from __future__ import annotations

import json
import math
import statistics
import sys
import time
from pathlib import Path

import numpy as np

GROUND_M = 400.0
"""Half of the side of the square that stands for the ground."""

FACES = (
    (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
)  # fmt: skip
"""Triangles of a box: the underside from one corner round, then the top."""


def main() -> None:
    """Answer the request."""
    import open3d as o3d

    request = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    g = GROUND_M
    vertices = [np.array([[-g, -g, 0.0], [g, -g, 0.0], [g, g, 0.0], [-g, g, 0.0]])]
    faces = [np.array([[0, 1, 2], [0, 2, 3]])]
    for x, y, z, yaw, x0, y0, z0, x1, y1, z1 in request["boxes"]:
        along, across = np.array([x0, x1, x1, x0]), np.array([y0, y0, y1, y1])
        c, s = math.cos(yaw), math.sin(yaw)
        outline = np.column_stack((x + c * along - s * across, y + s * along + c * across))
        corners = np.empty((8, 3))
        corners[:4, :2] = corners[4:, :2] = outline
        corners[:4, 2], corners[4:, 2] = z + z0, z + z1
        faces.append(np.array(FACES) + sum(len(block) for block in vertices))
        vertices.append(corners)
    core = o3d.core
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        core.Tensor(np.concatenate(vertices).astype(np.float32)),
        core.Tensor(np.concatenate(faces).astype(np.uint32)),
    )
    spent_ms = []
    for name in request["tables"]:
        direction = np.load(name).astype(np.float32)
        rays = np.zeros((len(direction), 6), dtype=np.float32)
        rays[:, 2], rays[:, 3:] = request["height_m"], direction
        tensor = core.Tensor(rays)
        ranges = scene.cast_rays(tensor, nthreads=1)["t_hit"].numpy()
        np.save(name.replace(".npy", ".ranges.npy"), ranges)
        rounds = []
        for _ in range(request["rounds"]):
            start = time.process_time()
            scene.cast_rays(tensor, nthreads=1)
            rounds.append(time.process_time() - start)
        spent_ms.append(1e3 * statistics.median(rounds))
    print(json.dumps({"spent_ms": spent_ms}))


if __name__ == "__main__":
    main()
