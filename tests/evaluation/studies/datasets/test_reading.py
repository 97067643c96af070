"""Frames of data sets that are damaged in ways that look sound."""

import json
from pathlib import Path

import pytest

from evaluation.studies.datasets.reading import _nuscenes_splits
from scenarios.errors import DatasetError


def test_a_scene_in_two_splits_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "splits.json"
    path.write_text(json.dumps({"smartmot_train": ["a", "b"], "val": ["c"]}))
    assert _nuscenes_splits(path) == {"a": "train", "b": "train", "c": "val"}
    path.write_text(json.dumps({"smartmot_train": ["a", "b"], "smartmot_test": ["b"]}))
    with pytest.raises(DatasetError, match="scene b is in the splits train and test"):
        _nuscenes_splits(path)
