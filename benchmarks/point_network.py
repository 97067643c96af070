"""Whether a point-based two-stage detector can be trained and run on a processor: times, and what it sees.

    python -m benchmarks.point_network [--kitti DIR] [--frames 40] [--rounds 5]

Needs the extra `train`. Only the backbone of PointRCNN is measured (Shi, Wang, Li, CVPR 2019; PointNet++ with
two radii a level, layer sizes of its published configuration, `tools/cfgs/default.yaml`), on 4,096 points
instead of its 16,384 and with all counts of points a quarter; then with a quarter of all widths too. Heads,
proposals and the second stage come on top. One thread.

1. Processor time of a frame forwards, and forwards and backwards, beside the pillar network's; of the
   exported graph in onnxruntime. Farthest point sampling has no operator in ONNX: its rows are inputs of the
   graph, and its time, compiled or in numpy, is said apart. Balls and interpolation are TopK over all
   distances.
2. Minutes for as many samples as the pillar network sees in so many minutes of training.
3. Of road users with 10 points or more in the cells of the pillar network: the share that has fewer left
   among 4,096 points, drawn evenly, or as PointRCNN does (all beyond 40 m, the others at random), or evenly
   of what is over the ground. On simulated frames of `hdl64`, and with `--kitti` on a folder of KITTI's
   object data.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from evaluation.studies.datasets.reading import read_frames
from evaluation.studies.lidar.detect import host_name
from evaluation.studies.lidar.drawn import CLASSES, drawn_frames
from evaluation.studies.training.export import onnx_bytes
from evaluation.studies.training.network import PillarNetwork, loss_of
from evaluation.studies.training.samples import Changes, LabelledFrame, batch, changed, labelled_frame
from scenarios.catalogue.maps import SHIPPED_MAPS, shipped_map
from scenarios.sensors.lidar import HDL64
from smartmot.arrays import BoolArray, FloatArray, IntArray
from smartmot.lidar.learned import Decoder, LearnedConfig, PillarGrid, pillars_of

POINTS = 4096

LEVELS = (1024, 256, 64, 16)
"""Points that each level keeps: a quarter of PointRCNN's 4096, 1024, 256 and 64."""

RADII_M = ((0.1, 0.5), (0.5, 1.0), (1.0, 2.0), (2.0, 4.0))

NEIGHBOURS = (16, 32)

WIDTHS = (
    ((16, 16, 32), (32, 32, 64)),
    ((64, 64, 128), (64, 96, 128)),
    ((128, 196, 256), (128, 196, 256)),
    ((256, 256, 512), (256, 384, 512)),
)

BACK = ((128, 128), (256, 256), (512, 512), (512, 512))
"""Widths of feature propagation, the finest level first."""

LEAST_POINTS = 10

FAR_M = 40.0
"""From where on PointRCNN keeps every point (its loader of KITTI)."""

GROUND_M = 0.25
"""Points lower over the ground are not those of road users, as in the classical detector."""

FRAMES_PER_STEP = 4
"""As in the training of the pillar network."""

MINUTES = 30.0


def farthest(xyz: FloatArray, count: int) -> IntArray:
    """(count,) rows, each the farthest from all before it (Qi et al., PointNet++, 2017)."""
    chosen = np.zeros(count, dtype=np.int64)
    distance = np.full(len(xyz), np.inf)
    for k in range(1, count):
        step = xyz - xyz[chosen[k - 1]]
        np.minimum(distance, np.einsum("ij,ij->i", step, step), out=distance)
        chosen[k] = int(distance.argmax())
    return chosen


def levels_of(xyz: FloatArray, pick: Callable[[FloatArray, int], IntArray]) -> list[IntArray]:
    """Rows of each level in the level before it."""
    rows = []
    for count in LEVELS:
        rows.append(pick(xyz, count))
        xyz = xyz[rows[-1]]
    return rows


def _layers(widths: tuple[int, ...]) -> nn.Sequential:
    layers: list[nn.Module] = []
    for before, after in pairwise(widths):
        layers += [nn.Linear(before, after), nn.ReLU()]
    return nn.Sequential(*layers)


def _distances(a: Tensor, b: Tensor) -> Tensor:
    """(A, B) squares of distances."""
    return (a * a).sum(1)[:, None] - 2.0 * a @ b.T + (b * b).sum(1)


class PointBackbone(nn.Module):
    """Set abstraction with two radii a level, and feature propagation back to all points.

    Args:
        share: of all widths.
    """

    def __init__(self, share: float) -> None:
        super().__init__()

        def scaled(widths: tuple[int, ...]) -> tuple[int, ...]:
            return tuple(max(round(share * width), 1) for width in widths)

        self.down, self.up = nn.ModuleList(), nn.ModuleList()
        before, sizes = 1, [1]
        for widths in WIDTHS:
            own = [scaled(each) for each in widths]
            self.down.append(nn.ModuleList(_layers((before + 3, *each)) for each in own))
            before = sum(each[-1] for each in own)
            sizes.append(before)
        for level in reversed(range(len(BACK))):
            widths_back = scaled(BACK[level])
            self.up.append(_layers((sizes[level] + before, *widths_back)))
            before = widths_back[-1]

    def forward(self, xyz: Tensor, first: Tensor, second: Tensor, third: Tensor, fourth: Tensor) -> Tensor:
        """(P, F) features of (P, 3) points; rows of each level, see `levels_of`."""
        places, features = [xyz], [torch.linalg.vector_norm(xyz, dim=1, keepdim=True)]
        for radii, networks, rows in zip(RADII_M, self.down, (first, second, third, fourth), strict=True):
            centre = places[-1][rows]
            square = _distances(centre, places[-1])
            pooled = []
            for radius, count, network in zip(radii, NEIGHBOURS, networks, strict=True):
                near, index = square.topk(min(count, square.shape[1]), dim=1, largest=False)
                # outside the ball the nearest stands again, which changes no maximum
                index = torch.where(near <= radius**2, index, index[:, :1])
                offset = places[-1][index] - centre[:, None]
                pooled.append(network(torch.cat((offset, features[-1][index]), 2)).amax(1))
            places.append(centre)
            features.append(torch.cat(pooled, 1))
        at = features[-1]
        for level, network in zip(reversed(range(len(BACK))), self.up, strict=True):
            square, index = _distances(places[level], places[level + 1]).topk(3, dim=1, largest=False)
            weight = 1.0 / (square.relu() + 1e-4)
            spread = (at[index] * (weight / weight.sum(1, keepdim=True))[:, :, None]).sum(1)
            at = network(torch.cat((features[level], spread), 1))
        return at


def milliseconds(job: Callable[[], object], rounds: int) -> float:
    """Median processor time of a job; the first call is not counted."""
    job()
    spent = []
    for _ in range(rounds):
        start = time.process_time()
        job()
        spent.append(1e3 * (time.process_time() - start))
    return statistics.median(spent)


def exported(network: PointBackbone, given: tuple[Tensor, ...]) -> Any:
    """The graph in onnxruntime, one thread."""
    import onnxruntime

    names = ["xyz", "first", "second", "third", "fourth"]
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter's own
        path = Path(folder) / "points.onnx"
        torch.onnx.export(
            network, given, path, input_names=names, output_names=["features"], opset_version=18, dynamo=True,
            external_data=False, verbose=False, optimize=True,
        )  # fmt: skip
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        return onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])


def measure(share: float, xyz: FloatArray, rounds: int) -> tuple[float, float, float, float]:
    """Parameters, ms forwards, ms forwards and backwards, ms in onnxruntime."""
    torch.manual_seed(1)
    network = PointBackbone(share)
    rows = [torch.from_numpy(each) for each in levels_of(xyz, farthest)]
    given = (torch.from_numpy(xyz.astype(np.float32)), *rows)

    def forwards() -> None:
        with torch.no_grad():
            network(*given)

    def both() -> None:
        network.zero_grad()
        network(*given).square().mean().backward()

    session = exported(network.eval(), given)
    feed = {entry.name: each.numpy() for entry, each in zip(session.get_inputs(), given, strict=True)}
    with torch.no_grad():
        difference = float(np.abs(session.run(None, feed)[0] - network(*given).numpy()).max())
    if not difference < 1e-3:
        raise SystemExit(f"the exported graph differs by {difference:.2g}")
    count = sum(each.numel() for each in network.parameters())
    in_onnx = milliseconds(lambda: session.run(None, feed), rounds)
    return count, milliseconds(forwards, rounds), milliseconds(both, rounds), in_onnx


def pillar_step_ms(frame: LabelledFrame, rounds: int) -> float:
    """Processor time of a frame in a step of the pillar network's training."""
    decoder = Decoder(PillarGrid(), CLASSES)
    network, rng = PillarNetwork(decoder), np.random.default_rng(1)

    def step() -> None:
        made = batch([changed(frame, Changes(), rng) for _ in range(FRAMES_PER_STEP)], decoder, 5)
        output = network(
            torch.from_numpy(made.seen.features), torch.from_numpy(made.seen.cell), FRAMES_PER_STEP
        )
        network.zero_grad()
        sum(loss_of(output, made.targets, len(CLASSES)), torch.zeros(())).backward()

    return milliseconds(step, rounds) / FRAMES_PER_STEP


def pillar_onnx_ms(frame: LabelledFrame, rounds: int) -> float:
    """Processor time of the pillar network in onnxruntime, pillars of the frame included."""
    decoder = Decoder(PillarGrid(), CLASSES)
    plain = [1.0] * len(CLASSES), [0.0] * len(CLASSES)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "pillars.onnx"
        path.write_bytes(onnx_bytes(PillarNetwork(decoder), decoder, *plain, {}))
        network = LearnedConfig(path).network
    return milliseconds(
        lambda: network.run(pillars_of(frame.points[:, :2], frame.points[:, 2], decoder.grid)), rounds
    )


def in_cells(points: FloatArray) -> BoolArray:
    """(P,) whether points are where the pillar network looks."""
    grid = PillarGrid()
    (near, far), (right, left), (low, high) = grid.ahead_m, grid.left_m, grid.heights_m
    x, y, z = points.T
    inside: BoolArray = (x >= near) & (x < far) & (y >= right) & (y < left) & (z >= low) & (z <= high)
    return inside


def sample_evenly(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Every point as likely as any other."""
    return points[rng.permutation(len(points))[:POINTS]]


def sample_far_first(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    """All beyond `FAR_M`, as many of the others as there is room for."""
    near = np.hypot(points[:, 0], points[:, 1]) < FAR_M
    far = points[~near][:POINTS]
    return np.concatenate((far, points[near][rng.permutation(int(near.sum()))[: POINTS - len(far)]]))


def sample_over_ground(points: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Evenly of what is over the ground."""
    return sample_evenly(points[points[:, 2] > GROUND_M], rng)


SAMPLINGS = {"evenly": sample_evenly, "far first": sample_far_first, "over the ground": sample_over_ground}


def losses(frames: list[LabelledFrame], seed: int = 1) -> tuple[list[tuple[str, ...]], FloatArray]:
    """Rows of sampling, class, range, road users, share left with too few points; points of the clouds."""
    labels: Counter[tuple[str, str, str]] = Counter()
    lost: Counter[tuple[str, str, str]] = Counter()
    sizes = []
    for number, frame in enumerate(frames):
        points = frame.points.astype(np.float64)
        points = points[in_cells(points)]
        sizes.append(len(points))
        before = frame.boxes.point_counts(points, 0.05)
        center = frame.boxes.center_m
        distance = np.hypot(center[:, 0], center[:, 1])
        counted = (before >= LEAST_POINTS) & (distance < FAR_M) & np.isin(frame.category, CLASSES)
        for name, sampled in SAMPLINGS.items():
            after = frame.boxes.point_counts(sampled(points, np.random.default_rng((seed, number))), 0.05)
            for row in np.flatnonzero(counted).tolist():
                part = (name, str(frame.category[row]), "0-20 m" if distance[row] < 20.0 else "20-40 m")
                labels[part] += 1
                lost[part] += int(after[row] < LEAST_POINTS)
    rows = [
        (*part, str(labels[part]), f"{100.0 * lost[part] / labels[part]:.0f} %") for part in sorted(labels)
    ]
    return rows, np.array(sizes, dtype=np.float64)


def simulated(count: int) -> Iterator[LabelledFrame]:
    """Frames of `hdl64` on shipped maps."""
    maps = [shipped_map(name) for name in SHIPPED_MAPS]
    for number, frame in enumerate(drawn_frames(maps, HDL64, count, 18)):
        yield labelled_frame(str(number), frame.cloud, frame.boxes, frame.category, 60.0)


def of_kitti(folder: Path) -> Iterator[LabelledFrame]:
    """Frames of a folder of KITTI's object data."""
    for frame in read_frames(folder):
        yield labelled_frame(frame.name, frame.cloud, frame.boxes, frame.labels.category, 60.0)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kitti", type=Path, help="folder of KITTI's object data")
    parser.add_argument("--frames", type=int, default=40, help="simulated frames")
    parser.add_argument("--rounds", type=int, default=5, help="of which the median is taken")
    options = parser.parse_args()
    torch.set_num_threads(1)
    frames = {"simulated hdl64": list(simulated(options.frames))}
    if options.kitti is not None:
        frames[str(options.kitti)] = list(of_kitti(options.kitti))

    first = frames["simulated hdl64"][0]
    points = first.points.astype(np.float64)
    xyz = sample_evenly(points[in_cells(points)], np.random.default_rng(1))
    pillar_ms = pillar_step_ms(first, options.rounds)
    passes = MINUTES * 60e3 / pillar_ms
    print(f"{host_name()}; processor time, one thread, median of {options.rounds}")
    print(
        f"pillar network: {pillar_ms:.0f} ms a frame of a training step, {passes:,.0f} in {MINUTES:g} "
        f"minutes; {pillar_onnx_ms(first, options.rounds):.0f} ms a frame in onnxruntime with its pillars"
    )
    print(f"{'backbone':18} {'parameters':>10} {'forwards':>9} {'and back':>9} {'onnx':>7} {'minutes':>8}")
    for name, share in (("paper's widths", 1.0), ("a quarter of them", 0.25)):
        count, forwards, both, in_onnx = measure(share, xyz, options.rounds)
        minutes = passes * both / 60e3
        print(f"{name:18} {count:10,.0f} {forwards:9.0f} {both:9.0f} {in_onnx:7.0f} {minutes:8.0f}")
    print(
        f"farthest points in numpy: {milliseconds(lambda: levels_of(xyz, farthest), options.rounds):.0f} ms"
    )
    try:
        import numba
    except ImportError:
        print("no numba: farthest points are not measured compiled")
    else:
        compiled = numba.njit(_farthest_loop)
        spent = milliseconds(lambda: levels_of(xyz, compiled), options.rounds)
        print(f"farthest points compiled: {spent:.1f} ms")

    for source, given in frames.items():
        rows, sizes = losses(given)
        print(
            f"{source}: {len(given)} frames, {np.median(sizes):,.0f} points in the cells in the median, "
            f"{(sizes <= POINTS).sum()} with {POINTS} or fewer; road users with {LEAST_POINTS} points or "
            "more, and the share with fewer after sampling"
        )
        for row in rows:
            print(f"  {row[0]:16} {row[1]:11} {row[2]:8} {row[3]:>5} {row[4]:>6}")


def _farthest_loop(xyz: FloatArray, count: int) -> IntArray:
    """`farthest` as loops, to be compiled."""
    chosen = np.zeros(count, dtype=np.int64)
    distance = np.full(len(xyz), np.inf)
    for k in range(1, count):
        x, y, z = xyz[chosen[k - 1]]
        best, at = -1.0, 0
        for j in range(len(xyz)):
            square = (xyz[j, 0] - x) ** 2 + (xyz[j, 1] - y) ** 2 + (xyz[j, 2] - z) ** 2
            if square < distance[j]:
                distance[j] = square
            if distance[j] > best:
                best, at = distance[j], j
        chosen[k] = at
    return chosen


if __name__ == "__main__":
    main()
