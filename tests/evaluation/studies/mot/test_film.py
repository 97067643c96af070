"""Films: real time, legible, and clear when ffmpeg is missing."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from evaluation.errors import ArgumentError
from evaluation.studies.mot.film import Film
from evaluation.studies.mot.forecasts import carried_on
from evaluation.studies.mot.tracking import TrackedSequence
from evaluation.views.film.maker import ffmpeg
from opendrive import load_map
from scenarios.catalogue.maps import shipped_map
from scenarios.recorded.dataset import Sequence


def film(
    objects: Any, frames: range, stamps: tuple[float, ...] = (0.0, 0.1, 0.25, 0.3), **options: Any
) -> Film:
    """A car that drives to the right at 10 m/s, seen from above."""
    rows = [(k, 3, 10.0 * t, 0.0) for k, t in enumerate(stamps)]
    cars = objects(rows)
    tracks = objects(rows, velocity_mps=np.tile((10.0, 0.0), (len(rows), 1)))
    names = tuple(map(str, range(len(rows))))
    sequence = Sequence("drive", np.array(stamps), names, cars, cars, options.pop("pose", None))
    zeros = np.zeros(len(rows))
    tracked = TrackedSequence(sequence, tracks, zeros, np.zeros((len(rows), 2)), zeros)
    return Film(tracked, carried_on("cv"), frames, **options)


def durations(path: Path) -> list[int]:
    found = []
    with Image.open(path) as image:
        for k in range(image.n_frames):  # type: ignore[attr-defined]
            image.seek(k)
            found.append(image.info["duration"])
    return found


def dark_columns(path: Path, frame: int, colour: tuple[int, int, int]) -> np.ndarray:
    """Picture columns that hold a colour."""
    with Image.open(path) as image:
        image.seek(frame)
        pixels = np.asarray(image.convert("RGB")).astype(int)
    near = np.abs(pixels - np.array(colour)).max(axis=2) < 40
    return np.flatnonzero(near[40:400].any(axis=0))


def test_a_gif_plays_in_real_time(objects: Any, tmp_path: Path) -> None:
    path = tmp_path / "new" / "film.gif"
    seen: list[int] = []
    film(objects, range(4)).write(path, "--gif", lambda: seen.append(1))
    assert durations(path) == [100, 150, 50, 100]
    assert len(seen) == 4


def test_chosen_frames(objects: Any, tmp_path: Path) -> None:
    film(objects, range(1, 3)).write(tmp_path / "film.gif", "--gif")
    assert durations(tmp_path / "film.gif") == [150, 150]


def test_the_track_moves_in_the_picture(objects: Any, tmp_path: Path) -> None:
    """Without ego poses the picture stands still, and the track, 3 modulo 6 purple, goes to the right."""
    film(objects, range(4)).write(tmp_path / "film.gif", "--gif")
    purple = (0xCC, 0x79, 0xA7)
    first, last = (dark_columns(tmp_path / "film.gif", k, purple) for k in (0, 3))
    assert len(first)
    assert last.max() > first.max()


def test_on_a_map_with_ego_poses(objects: Any, tmp_path: Path) -> None:
    network = load_map(shipped_map("urban_street"))
    pose = np.tile(np.eye(4), (4, 1, 1))
    pose[:, :2, 3] = 20.0, -1.75  # in a lane
    film(objects, range(2), network=network, pose=pose).write(tmp_path / "map.gif", "--gif")
    film(objects, range(2), pose=pose).write(tmp_path / "plain.gif", "--gif")

    def pixels(name: str) -> np.ndarray:
        with Image.open(tmp_path / name) as image:
            image.seek(1)
            return np.asarray(image.convert("RGB"))

    assert (pixels("map.gif") != pixels("plain.gif")).any(axis=2).mean() > 0.05
    # the vehicle is seen on the map as without it
    dark, view = np.array((0x4D, 0x4D, 0x4D)), slice(40, 400)
    seen = [
        (np.abs(pixels(n)[view].astype(int) - dark).max(axis=2) < 12).sum() for n in ("map.gif", "plain.gif")
    ]
    assert seen[1] > 100
    assert seen[0] == pytest.approx(seen[1], rel=0.1)


def test_video_without_ffmpeg_is_one_clear_error(
    objects: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(ArgumentError, match=r"--video: MP4 films need the extra film .*\[film\].*use --gif"):
        film(objects, range(2)).write(tmp_path / "film.mp4", "--video")
    assert not (tmp_path / "film.mp4").exists()


def test_video_has_a_picture_for_every_frame(objects: Any, tmp_path: Path) -> None:
    path = tmp_path / "new" / "film.mp4"
    try:
        program = ffmpeg("--video")
    except ArgumentError as error:
        pytest.skip(str(error))
    film(objects, range(4)).write(path, "--video")
    assert path.read_bytes()[4:8] == b"ftyp"
    said = subprocess.run([program, "-i", str(path), "-f", "null", "-"], capture_output=True, text=True)
    assert int(said.stderr.split("frame=")[-1].split()[0]) == 4


def test_a_video_that_cannot_be_written(objects: Any, tmp_path: Path) -> None:
    try:
        ffmpeg("--video")
    except ArgumentError as error:
        pytest.skip(str(error))
    (tmp_path / "film.mp4").mkdir()
    with pytest.raises(ArgumentError, match="--video: cannot write"):
        film(objects, range(4)).write(tmp_path / "film.mp4", "--video")


def test_a_film_is_written_as_a_whole_or_not_at_all(
    objects: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "film.gif"
    path.write_bytes(b"before")

    def full(part: Path, content: bytes) -> int:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ArgumentError, match=r"film\.gif: No space left on device"):
        film(objects, range(2)).write(path, "--gif")
    assert path.read_bytes() == b"before"


def test_a_gif_that_cannot_be_written(objects: Any, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ArgumentError, match="--gif: cannot write"):
        film(objects, range(2)).write(tmp_path / "file" / "film.gif", "--gif")
