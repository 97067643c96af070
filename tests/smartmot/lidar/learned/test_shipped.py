"""The shipped network: the file of its card, and what it finds on streets that it has not learned from."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.training_frames import fresh_streets
from evaluation.studies.detectors.quality import QualityOptions, measured_quality
from smartmot.errors import ConfigError
from smartmot.lidar.learned import SHIPPED, shipped, shipped_card, shipped_network


@pytest.mark.parametrize("name", SHIPPED)
def test_the_file_is_that_of_its_card(name: str) -> None:
    path, card = shipped.FOLDER / f"{name}.onnx", shipped_card(name)
    content = path.read_bytes()
    assert len(content) == card["bytes"]
    assert 100_000 < len(content) < 2_000_000
    assert hashlib.sha256(content).hexdigest() == card["sha256"]
    network = shipped_network(name).network
    assert list(network.decoder.classes) == card["classes"]
    assert network.origin["training"] == card["training"]
    assert shipped_network(name).least_scores.tolist() == card["least_score"]
    assert shipped_network(name, 0.25).least_scores.tolist() == [0.25] * len(card["classes"])


def test_integers_are_made_of_the_shipped_network() -> None:
    plain, small = shipped_card("pillars"), shipped_card("pillars_int8")
    assert small["made_of"] == plain["sha256"]
    assert small["bytes"] < 0.5 * plain["bytes"]
    for name, best in small["held_out"].items():
        assert best["labels"] == plain["held_out"][name]["labels"]
        assert best["f1"] == pytest.approx(plain["held_out"][name]["f1"], abs=0.02)


def test_least_scores_are_one_for_all_or_one_for_each_class() -> None:
    config = shipped_network()
    assert replace(config, least_score=(0.1, 0.2, 0.3)).least_scores.tolist() == [0.1, 0.2, 0.3]
    with pytest.raises(ConfigError, match="least_score: 2 scores for 3 classes"):
        _ = replace(config, least_score=(0.1, 0.2)).least_scores
    with pytest.raises(ConfigError, match=r"least_score: must lie in \[0, 1\]"):
        replace(config, least_score=(0.1, 1.2, 0.3))


def test_another_file_in_its_place_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "weights"
    shutil.copytree(shipped.FOLDER, folder)
    monkeypatch.setattr(shipped, "FOLDER", folder)
    path = folder / "pillars.onnx"
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(ConfigError, match="is not the network with SHA-256"):
        shipped_network()
    path.write_bytes(content[:-1])
    with pytest.raises(ConfigError, match=f"has {len(content) - 1} bytes in place of {len(content)}"):
        shipped_network()
    path.unlink()
    with pytest.raises(ConfigError, match="has 0 bytes"):
        shipped_network()
    (folder / "pillars.json").write_text(json.dumps({"bytes": 3}))
    with pytest.raises(ConfigError, match="missing or damaged"):
        shipped_network()


def test_an_unknown_name_is_one_line() -> None:
    with pytest.raises(ConfigError, match="no 'pointy' is shipped; choose pillars"):
        shipped_network("pointy")


@pytest.mark.parametrize("name", SHIPPED)
def test_it_finds_road_users_on_fresh_streets(name: str) -> None:
    """Few frames, so that the bounds are far under what docs/learned.md measures on many."""
    boxes, account = measured_quality(fresh_streets(24, 4242), shipped_network(name), QualityOptions(10))
    assert account.clouds == 24
    assert {name: each.labels >= 20 for name, each in boxes.items()} == dict.fromkeys(boxes, True)
    least = {"car": 0.85, "pedestrian": 0.7, "cyclist": 0.7}
    assert {name: each.f1(0.0) > least[name] for name, each in boxes.items()} == dict.fromkeys(boxes, True)
