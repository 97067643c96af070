"""Training on a few frames: it learns, goes on where it stopped, and its files say what the network says."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

if os.environ.get("SMARTMOT_TRAIN") == "required":
    import torch
else:
    torch = pytest.importorskip("torch", reason="PyTorch is not installed: `.ci/train` runs these tests")
    pytest.importorskip("onnxscript", reason="onnxscript is not installed: `.ci/train` runs these tests")

from evaluation.errors import ArgumentError
from evaluation.studies.training import NETWORK, fit, study
from evaluation.studies.training.export import greatest_difference, onnx_bytes
from evaluation.studies.training.fit import CHECKPOINT, Training, TrainingError, TrainingOptions
from evaluation.studies.training.graphs import quantised, streamlined
from evaluation.studies.training.network import PillarNetwork
from evaluation.studies.training.samples import LabelledFrame, batch
from evaluation.studies.training.study import CARD, write_card
from smartmot.lidar import LearnedConfig, detect
from smartmot.lidar.learned import Decoder, PillarGrid, pillars_of
from smartmot.pointcloud import Boxes3D, PointCloud

DECODER = Decoder(PillarGrid((0.0, 16.0), (-8.0, 8.0), 0.5, 8), ("car", "pedestrian", "cyclist"))
OPTIONS = TrainingOptions(steps=60, frames_per_step=2, rate=1e-2)


def made(seed: int) -> LabelledFrame:
    """A person somewhere: points on a cylinder, ground around."""
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(3.0, 13.0), rng.uniform(-6.0, 6.0)
    angle, up = rng.uniform(0.0, 2 * np.pi, 80), rng.uniform(0.0, 1.8, 80)
    body = np.column_stack((x + 0.3 * np.cos(angle), y + 0.3 * np.sin(angle), up))
    ground = np.column_stack((rng.uniform((0.0, -8.0), (16.0, 8.0), (300, 2)), np.zeros(300)))
    box = Boxes3D(np.array([[x, y, 0.9]]), np.array([[0.6, 0.6, 1.8]]), np.zeros(1))
    points = np.concatenate((body, ground)).astype(np.float32)
    return LabelledFrame(
        f"f{seed}", points, np.zeros(380, dtype=np.int64), box, np.array(["pedestrian"]), np.array([80])
    )


FRAMES = [made(k) for k in range(12)]


def training(folder: Path, options: TrainingOptions = OPTIONS) -> Training:
    folder.mkdir(exist_ok=True)
    return Training(folder, DECODER, options, FRAMES[:8], FRAMES[8:])


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Training:
    one = training(tmp_path_factory.mktemp("trained") / "run")
    one.run(lambda progress, share: None)
    return one


def test_losses_fall_and_bodies_are_found(trained: Training) -> None:
    rows = trained.progress.rows
    first, last = (
        np.mean([row["loss_scores"] + row["loss_boxes"] for row in part]) for part in (rows[:5], rows[-5:])
    )
    assert last < 0.5 * first
    assert rows[-1]["f1_pedestrian"] > 0.3
    assert trained.share == 1.0


def test_points_that_fill_pillars_change_nothing() -> None:
    """In training they are left out: same features and same gradients."""
    made = batch(FRAMES[:2], [DECODER] * 2, OPTIONS.least_points)
    features, cell = torch.from_numpy(made.seen.features), torch.from_numpy(made.seen.cell)
    torch.manual_seed(3)
    network = PillarNetwork(DECODER)
    pillars = network.of_points(features).amax(1)
    pillars.square().sum().backward()  # type: ignore[no-untyped-call]
    wanted = [weight.grad.clone() for weight in network.of_points.parameters() if weight.grad is not None]
    network.zero_grad()
    own = network._of_own_points(features)
    torch.testing.assert_close(own, pillars, rtol=0.0, atol=0.0)
    own.square().sum().backward()  # type: ignore[no-untyped-call]
    assert len(wanted) == 4
    for weight, gradient in zip(network.of_points.parameters(), wanted, strict=True):
        torch.testing.assert_close(weight.grad, gradient, rtol=1e-4, atol=1e-4)
    assert len(cell) == len(own)


def test_curves_are_a_table(trained: Training) -> None:
    lines = (trained.folder / "training.csv").read_text().splitlines()
    assert lines[0].startswith("step,elapsed_s,rate,loss_scores,loss_boxes,loss_held_out,f1_car")
    assert len(lines) == 61


def test_a_training_that_was_stopped_goes_on_to_the_same_network(tmp_path: Path, trained: Training) -> None:
    class StopError(Exception):
        pass

    def stop(progress: fit.Progress, share: float) -> None:
        if progress.step == 33:
            raise StopError

    one = training(tmp_path / "run")
    with pytest.raises(StopError):
        one.run(stop)
    again = training(tmp_path / "run")
    assert 0 < again.progress.step <= 33
    again.run(lambda progress, share: None)
    for name, value in again.network.state_dict().items():
        torch.testing.assert_close(value, trained.network.state_dict()[name], rtol=0.0, atol=0.0)


def test_a_folder_of_another_training_is_refused(tmp_path: Path) -> None:
    one = training(tmp_path / "run", replace(OPTIONS, steps=1))
    one.run(lambda progress, share: None)
    with pytest.raises(ArgumentError, match="holds a training of other frames or with other options"):
        training(tmp_path / "run", replace(OPTIONS, steps=2))
    (tmp_path / "run" / CHECKPOINT).write_bytes(b"nothing")
    with pytest.raises(ArgumentError, match="is no checkpoint of a training, or damaged"):
        training(tmp_path / "run", replace(OPTIONS, steps=1))


def test_labels_sizes_lines_and_splits_are_part_of_a_training(tmp_path: Path) -> None:
    one = FRAMES[0]
    others = (
        replace(one, category=np.array(["car"])),
        replace(one, boxes=replace(one.boxes, size_m=2.0 * one.boxes.size_m)),
        replace(one, boxes=replace(one.boxes, yaw_rad=one.boxes.yaw_rad + 1.0)),
        replace(one, counts=one.counts + 1),
        replace(one, line=one.line + 1),
    )
    sets = [(FRAMES[:8], FRAMES[8:]), (FRAMES[:7], FRAMES[7:])]
    sets += [([other, *FRAMES[1:8]], FRAMES[8:]) for other in others]
    keys = {Training(tmp_path, DECODER, OPTIONS, learned, held_out).key for learned, held_out in sets}
    assert len(keys) == len(sets)


def test_a_network_that_its_file_does_not_match_is_not_written(
    tmp_path: Path, trained: Training, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(study, "greatest_difference", lambda *given: float("nan"))
    with pytest.raises(ArgumentError, match="not written"):
        write_card(tmp_path, trained, {})
    assert not list(tmp_path.iterdir())


def test_code_in_a_checkpoint_is_not_run(tmp_path: Path) -> None:
    class Bad:
        def __reduce__(self) -> tuple[object, ...]:
            return (Path.touch, (tmp_path / "ran",))

    (tmp_path / "run").mkdir()
    torch.save({"key": Bad()}, tmp_path / "run" / CHECKPOINT)
    with pytest.raises(ArgumentError, match="is no checkpoint"):
        training(tmp_path / "run")
    assert not (tmp_path / "ran").exists()


def test_a_loss_that_is_not_finite_stops_with_frames_and_advice(tmp_path: Path) -> None:
    one = training(tmp_path / "run")
    with torch.no_grad():
        one.network.values.bias.fill_(float("nan"))
    with pytest.raises(
        TrainingError, match=r"step 1: the loss is not finite; frames f\d+, f\d+\. .* --rate 0.003"
    ):
        one.run(lambda progress, share: None)


def test_the_file_says_what_the_network_says(trained: Training) -> None:
    boxes = trained.boxes(trained.held_out)
    write_card(trained.folder, trained, boxes)
    card = json.loads((trained.folder / CARD).read_text())
    path = trained.folder / NETWORK
    assert card["greatest_difference"] <= 1e-4
    assert card["threads"] == torch.get_num_threads()
    assert greatest_difference(trained.network, path.read_bytes(), FRAMES, DECODER) <= 1e-4
    # after so few steps scores are low, and which they are depends on the processor
    config = LearnedConfig(path, card["sha256"], least_score=0.1)
    cloud = PointCloud(FRAMES[0].points - np.array([0.0, 0.0, 1.7], dtype=np.float32))
    found = detect(cloud, config)
    nearest = np.hypot(*(found.boxes.center_m[:, :2] - FRAMES[0].boxes.center_m[0, :2]).T)
    assert nearest.min() < 0.5  # a cell
    assert found.boxes.center_m[nearest.argmin(), 2] == pytest.approx(0.9 - 1.7, abs=0.3)


def test_the_same_network_gives_the_same_bytes(trained: Training) -> None:
    made = [
        onnx_bytes(trained.network, DECODER, [1.0] * 3, [0.0] * 3, [0.3] * 3, {"seed": 1}) for _ in range(2)
    ]
    assert made[0] == made[1]
    # it is the fast graph already, and torch's to rounding
    assert streamlined(made[0]) == made[0]
    assert b"DepthToSpace" in made[0]
    assert greatest_difference(trained.network, made[0], FRAMES, DECODER) < 1e-4


def test_integers_need_less_room_and_say_nearly_the_same(trained: Training, tmp_path: Path) -> None:
    content = onnx_bytes(trained.network, DECODER, [1.0] * 3, [0.0] * 3, [0.3] * 3, {"seed": 1})
    seen = [pillars_of(frame.points, frame.points[:, 2], DECODER.grid) for frame in FRAMES]
    small = quantised(content, seen)
    assert len(small) < 0.5 * len(content)
    # of the cells of all clouds together: single values beyond the mean range of a cloud are cut
    said = []
    for name, made in (("float", content), ("small", small)):
        (tmp_path / f"{name}.onnx").write_bytes(made)
        network = LearnedConfig(tmp_path / f"{name}.onnx").network
        said.append(np.concatenate([network.run(each).reshape(-1) for each in seen]))
    error = np.sqrt(np.square(said[1] - said[0]).mean())
    assert 1e-4 < error < 0.2 * said[0].std()


def test_impossible_options_are_refused() -> None:
    for words in ({"steps": 0}, {"minutes": 0.0}, {"rate": 0.0}, {"rate": float("nan")}):
        with pytest.raises(ArgumentError):
            TrainingOptions(**words)  # type: ignore[arg-type]
