"""Films: as many pictures and as long as asked for, of the right moments."""

from __future__ import annotations

import dataclasses
import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from benchmarks.film import whole_picture
from evaluation.errors import ArgumentError
from evaluation.results.files import log_path
from evaluation.results.logs import read_log
from evaluation.results.rows import read_runs
from evaluation.runs.folder import read_folder
from evaluation.views.account.explain import explain
from evaluation.views.film import maker
from evaluation.views.film.replay import drawing_of, replay, split_run
from evaluation.views.film.run import HOLD_S, RunDrawing, film_times
from evaluation.views.frames import frames_of
from evaluation.views.page.page import write_page
from evaluation.views.plots.ground import AREA_COLOURS
from tests.figures import text_faults

LONG_TITLE = "my_package.monitored.areas:variant_00_wide, a_scenario_with_a_long_name, 50 km/h, dry"


@pytest.fixture(scope="module")
def name(folder: Path) -> str:
    runs = read_runs(folder)
    return str(runs.loc[runs["collided"], "log"].iloc[0])


def end_of(folder: Path, name: str) -> float:
    log = read_log(log_path(folder, name))
    return float(log.loc[log["kind"] == "ego", "time_s"].max())


def test_a_gif_lasts_as_long_as_the_run(folder: Path, name: str, tmp_path: Path) -> None:
    path = tmp_path / "run.gif"
    counted: list[tuple[int, int]] = []
    written, notes = replay(
        folder / name, path, None, fps=5, speed=1.0, progress=lambda *now: counted.append(now)
    )
    assert (written, notes) == ([path], ())
    end = end_of(folder, name)
    with Image.open(path) as image:
        assert image.size == (960, 720)
        durations = []
        for frame in range(image.n_frames):
            image.seek(frame)
            durations.append(image.info["duration"])
    assert sum(durations) / 1000 == pytest.approx(end + HOLD_S, abs=0.2 + 1e-6)
    assert counted[-1] == (len(counted), len(counted))
    assert len(counted) == int(end * 5) + 2  # from 0 on, and the contact itself
    assert path.stat().st_size < 6e6


@pytest.mark.parametrize(("fps", "speed", "count"), [(20, 1, 21), (20, 0.5, 41), (20, 2, 11), (30, 1, 31)])
def test_number_of_pictures_and_their_moments(drive: Any, fps: float, speed: float, count: int) -> None:
    """A drive of 1 s at 20 frames per second."""
    times = film_times(frames_of(drive().log()), fps, speed)
    assert len(times.frame) == count
    assert times.frame[0] == 0
    assert times.frame[-1] == 20
    assert np.all(np.diff(times.frame) >= 0)
    # a GIF's clock counts hundredths of a second; what is rounded must not add up
    shown = times.durations_ms()
    assert sum(shown[:-1]) == pytest.approx(1000 * (count - 1) / fps, abs=10)
    assert shown[-1] == 1000 * HOLD_S


@pytest.mark.parametrize(("fps", "speed", "option"), [(0, 1, "--fps"), (60, 1, "--fps"), (20, 0, "--speed")])
def test_impossible_numbers_are_refused(drive: Any, fps: float, speed: float, option: str) -> None:
    with pytest.raises(ArgumentError, match=f"{option}: must lie in"):
        film_times(frames_of(drive().log()), fps, speed)


def test_pictures_move_with_the_run(folder: Path, name: str) -> None:
    results_folder = read_folder(folder)
    run = results_folder.runs[results_folder.runs["log"] == name].to_dict("records")[0]
    setup = results_folder.setups[name]
    frames = frames_of(results_folder.log(name), setup.strategy)
    film = RunDrawing(frames, explain(frames, run, setup), setup.network, "title")
    first, flag = film.picture(0), film.picture(frames.frame_at(run["flag_time_s"]))
    assert first.shape == flag.shape == (720, 960, 3)
    vermillion = np.array([0xD5, 0x5E, 0x00])
    # threats are drawn in one colour only: none at first, a ring at the flag
    view = slice(50, 525)
    assert (np.abs(first[view].astype(int) - vermillion).max(axis=2) < 8).sum() == 0
    assert (np.abs(flag[view].astype(int) - vermillion).max(axis=2) < 8).sum() > 100
    assert np.array_equal(film.picture(0), first)


def test_what_moves_over_what_stays_is_the_whole_picture(folder: Path, name: str) -> None:
    """Equal in every pixel to the figure drawn anew; forwards, backwards, and with another story between."""
    drawing, _ = drawing_of(folder / name)
    last = len(drawing.frames) - 1
    stories = drawing.account.story
    assert len(set(stories)) > 1
    for frame in (0, 1, last // 2, last, next(k for k in range(last) if stories[k] != stories[0]), 0):
        assert np.array_equal(drawing.picture(frame), whole_picture(drawing)), frame


def test_a_log_alone_is_a_film(folder: Path, name: str, tmp_path: Path) -> None:
    """As of a recorded drive: no table of runs, no scenario, no map. Boxes are drawn, lanes are not."""
    alone = tmp_path / "drive.parquet"
    shutil.copy(log_path(folder, name), alone)
    written, notes = replay(alone, None, None, fps=2, speed=1.0)
    assert written == [tmp_path / "drive.gif"]
    assert notes == ("Only the log is known: lanes and monitored areas are not drawn.",)
    log = read_log(alone)
    frames = frames_of(log)
    drawing = RunDrawing(frames, explain(frames), None, "drive")
    image = drawing.picture(len(frames) // 2).astype(int)
    ego = np.array([0x4D, 0x4D, 0x4D])
    # 4.4 m x 1.8 m at 19.2 pixels per metre, outlined
    drawn = (np.abs(image - ego).max(axis=2) < 8).sum()
    assert 0.5 < drawn / ((960 / 50) ** 2 * log["length_m"].iloc[0] * log["width_m"].iloc[0]) < 1.05
    road = np.array([0xD2, 0xD2, 0xD2])
    assert (np.abs(image[50:525] - road).max(axis=2) < 2).mean() < 0.001  # smoothed edges only


def test_long_texts_stay_in_the_picture(folder: Path, name: str) -> None:
    results_folder = read_folder(folder)
    run = results_folder.runs[results_folder.runs["log"] == name].to_dict("records")[0]
    frames = frames_of(results_folder.log(name))
    account = explain(frames, run)
    word = "Emergency brake for somebody wide, who moves in a margin. "
    told = dataclasses.replace(account, story=tuple(word * (k % 9) for k in range(len(frames))))
    film = RunDrawing(frames, told, None, "people at the kerb, 60 m bend left, near side, 0.4 m, " * 2)
    for frame in range(9):
        image = film.picture(frame).astype(int)
        # nothing but white at the edges beside the title and below the view, where the texts are
        for rows in (slice(0, 42), slice(540, 720)):
            for columns in (slice(0, 5), slice(-5, None)):
                assert image[rows, columns].min() > 250, (frame, rows, columns)
        # and a free strip between the story and the legend
        assert (image[640:680].min(axis=(1, 2)) > 250).any()


class Everything:
    """An area with every role, as at an intersection."""

    name = "map"

    def at(self, ego: Any) -> Any:
        rings = [(role, np.array([(0, 0), (9, 0), (9, 9)]) + 10.0 * k) for k, role in enumerate(AREA_COLOURS)]
        return type("Area", (), {"polygons": lambda _: rings})()


@pytest.mark.parametrize("strategy", [None, Everything()])
def test_texts_do_not_stand_over_each_other(folder: Path, name: str, strategy: Any) -> None:
    """Speed, acceleration and a long count of what perception holds share a line; the legend may be long."""
    results_folder = read_folder(folder)
    run = results_folder.runs[results_folder.runs["log"] == name].to_dict("records")[0]
    frames = frames_of(results_folder.log(name))
    story = "Emergency brake for another pedestrian, who stayed on the sidewalk, 12.3 m ahead then. " * 4
    status = "115.5 km/h, speeding up at 2.8 m/s² · 103 of 110 detections kept · 103 tracked, 10 on a "
    account = dataclasses.replace(
        explain(frames, run),
        status=(f"{status}collision course",) * len(frames),
        story=(story,) * len(frames),
    )
    film = RunDrawing(dataclasses.replace(frames, strategy=strategy), account, None, LONG_TITLE, "#d55e00")
    film.picture(0)
    assert text_faults(film.figure) == []
    # the strategy's colour, above the heading
    assert film.picture(0)[3, 480].tolist() == [0xD5, 0x5E, 0x00]


def test_mp4_has_all_pictures(folder: Path, name: str, tmp_path: Path) -> None:
    try:
        program = maker.ffmpeg("--mp4")
    except ArgumentError as error:
        pytest.skip(str(error))
    path = tmp_path / "run.mp4"
    replay(folder / name, None, path, fps=5, speed=1.0)
    said = subprocess.run(
        [program, "-i", str(path), "-f", "null", "-"], capture_output=True, text=True, check=True
    ).stderr
    frames = int(said.split("frame=")[-1].split()[0])
    assert frames == int(end_of(folder, name) * 5) + 2 + round(HOLD_S * 5)


def test_without_ffmpeg_one_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maker.shutil, "which", lambda _: None)
    monkeypatch.setitem(__import__("sys").modules, "imageio_ffmpeg", None)
    with pytest.raises(ArgumentError, match=r"--mp4: MP4 films need .*'smartmot\[film\]', or apt"):
        maker.ffmpeg("--mp4")


@pytest.mark.parametrize("run", ["out/a_30.5kmh_seed0", "out/logs/a_30.5kmh_seed0.parquet"])
def test_a_run_is_named_by_folder_and_log_or_by_its_file(run: str) -> None:
    assert split_run(Path(run)) == (Path("out"), "a_30.5kmh_seed0")


@pytest.mark.parametrize("place", ["no/run", "run"])
def test_a_place_that_cannot_be_written_is_told_before_anything_is_drawn(
    folder: Path, name: str, tmp_path: Path, place: str
) -> None:
    """A missing folder, and a folder in place of the file; the second film is no exception."""

    def never(done: int, total: int) -> None:
        raise AssertionError(f"{done} of {total} were drawn")

    (tmp_path / "run").mkdir()
    bad, good = tmp_path / place, tmp_path / "good"
    for gif, mp4, option in ((bad, None, "--gif"), (None, bad, "--mp4"), (good, bad, "--mp4")):
        with pytest.raises(ArgumentError, match=rf"{option}: cannot write .*{place}: "):
            replay(folder / name, gif, mp4, fps=2, speed=1.0, progress=never)
    with pytest.raises(ArgumentError, match=rf"--out: cannot write .*{place}: "):
        write_page(folder, bad, never)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    assert list((tmp_path / "run").iterdir()) == []


def test_mistakes_are_one_line(
    folder: Path, name: str, tmp_path: Path, command: Callable[..., int], capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "empty").mkdir()
    bare = tmp_path / "bare"
    bare.mkdir()
    for file in ("runs.csv", "runs.json"):
        (bare / file).write_text((folder / file).read_text())
    missing = json.dumps(str(tmp_path / "no" / "x.gif"))[1:-1]
    for arguments, answer in (
        (("replay", folder / "nothing"), "no run 'nothing'"),
        (("replay", folder / name, "--gif", missing), "cannot write"),
        (("replay", folder / name, "--fps", "0"), "--fps"),
        (("replay", bare / name), "nothing can be replayed"),
        (("report", bare), "nothing can be replayed"),
        (("report", tmp_path / "empty"), "runs.csv: no such file"),
        (("report", tmp_path / "gone"), "no such folder"),
        (("report", folder, "--out", tmp_path / "no" / "x.html"), "cannot write"),
    ):
        capfd.readouterr()
        assert command(*arguments, "--quiet") == 2, arguments
        said = capfd.readouterr()
        assert said.err.startswith("smartmot-eval: ")
        assert answer in said.err
        assert said.err.count("\n") == 1
        assert said.out == ""
