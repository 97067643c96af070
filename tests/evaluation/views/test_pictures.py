"""The standard pictures: which run they show, and that they are written as asked for."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from evaluation.errors import ArgumentError
from evaluation.results.files import log_path
from evaluation.results.logs import read_logs, write_log
from evaluation.results.rows import read_runs, write_runs
from evaluation.runs.cpna import CpnaSuite, load_site
from evaluation.runs.execution import execute
from evaluation.runs.specs import Conditions
from evaluation.studies.suite import suite_configuration
from evaluation.views import plots
from evaluation.views.pictures import save_map, save_picture, save_pictures
from scenarios.catalogue.cpna import Site
from scenarios.presets import named_preset
from scenarios.strategies import make_strategy
from smartmot.area import MonitoredAreaStrategy
from smartmot.types import EgoState

SUITE = CpnaSuite((20.0, 50.0, 60.0), Conditions(("map",), "paper", ("dry",), "urban_street"))


@dataclass
class Finished:
    """A folder of results, read back."""

    site: Site
    runs: pd.DataFrame
    logs: dict[str, pd.DataFrame]

    @property
    def area(self) -> MonitoredAreaStrategy:
        return make_strategy("map", named_preset("paper"), self.site)

    def name(self, speed_kmh: float) -> str:
        return str(self.runs.loc[self.runs["v_test_kmh"] == speed_kmh, "log"].item())


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Finished:
    folder = tmp_path_factory.mktemp("results")
    site = load_site(SUITE)
    rows = []
    for record in map(execute, SUITE.specs(site)):
        assert record.row.log is not None
        write_log(log_path(folder, record.row.log), record.log)
        rows.append(record.row)
    write_runs(folder, rows, suite_configuration(SUITE, site, folder))
    runs = read_runs(folder)
    return Finished(site, runs, read_logs(folder, runs))


@dataclass
class Drawn:
    """What the plotting functions were asked to draw."""

    calls: dict[str, tuple[Any, ...]] = field(default_factory=dict)


@pytest.fixture
def drawn(monkeypatch: pytest.MonkeyPatch) -> Drawn:
    """Plotting functions that only note what they are given."""
    noted = Drawn()

    def replace(name: str) -> None:
        def note(*arguments: Any) -> Figure:
            noted.calls[name] = arguments
            return Figure(figsize=(1, 1))

        monkeypatch.setattr(plots, name, note)

    for name in ("speed_curves", "temporal_diagram", "birdseye"):
        replace(name)
    return noted


def title_of(drawn: Drawn) -> str:
    return str(drawn.calls["temporal_diagram"][1])


def test_three_pictures_and_a_call_after_each(tmp_path: Path, finished: Finished) -> None:
    done: list[int] = []
    written = save_pictures(
        tmp_path,
        finished.runs,
        finished.logs,
        finished.site.network,
        finished.area,
        done=lambda: done.append(len(done)),
    )
    assert [p.name for p in written] == ["speed_curves.png", "temporal_diagram.png", "birdseye.png"]
    assert done == [0, 1, 2]
    for path in written:
        image = mpl.image.imread(path)
        assert image.shape[0] > 300
        assert image.shape[1] > 300
        assert np.ptp(image[..., :3]) > 0.5  # not blank


def test_shows_the_run_at_the_usual_speed_in_town(tmp_path: Path, finished: Finished, drawn: Drawn) -> None:
    save_pictures(tmp_path, finished.runs, finished.logs, finished.site.network, finished.area)
    assert title_of(drawn) == "CPNA, map, 50 km/h, dry, preset paper"
    assert drawn.calls["temporal_diagram"][0] is finished.logs[finished.name(50.0)]
    assert drawn.calls["speed_curves"][0] is finished.runs


def test_otherwise_the_fastest_run_with_a_flag(tmp_path: Path, finished: Finished, drawn: Drawn) -> None:
    runs = finished.runs[finished.runs["v_test_kmh"] != 50]
    save_pictures(tmp_path, runs, finished.logs, finished.site.network, finished.area)
    assert ", 60 km/h," in title_of(drawn)


def test_without_any_flag_the_last_run_at_its_end(tmp_path: Path, finished: Finished, drawn: Drawn) -> None:
    runs = finished.runs.assign(flag_time_s=np.nan)
    save_pictures(tmp_path, runs, finished.logs, finished.site.network, finished.area)
    assert ", 60 km/h," in title_of(drawn)
    assert drawn.calls["birdseye"][2] == finished.logs[finished.name(60.0)]["time_s"].max()


def test_the_run_asked_for(tmp_path: Path, finished: Finished, drawn: Drawn) -> None:
    save_pictures(
        tmp_path,
        finished.runs,
        finished.logs,
        finished.site.network,
        finished.area,
        shown=finished.name(20.0),
    )
    assert ", 20 km/h," in title_of(drawn)


def test_an_unknown_run_is_answered_with_the_known_ones(tmp_path: Path, finished: Finished) -> None:
    with pytest.raises(ArgumentError, match=r"--run: no run 'x'; the folder has: CPNA_map_.*20kmh.*, CPNA"):
        save_pictures(tmp_path, finished.runs, finished.logs, finished.site.network, finished.area, shown="x")


def test_birdseye_view_is_at_the_flag_with_the_area_of_that_time(
    tmp_path: Path, finished: Finished, drawn: Drawn
) -> None:
    save_pictures(tmp_path, finished.runs, finished.logs, finished.site.network, finished.area)
    _, log, time, areas, title = drawn.calls["birdseye"]
    flag = float(finished.runs.loc[finished.runs["v_test_kmh"] == 50, "flag_time_s"].item())
    assert time == flag
    assert title.endswith(f"; t = {flag:.2f} s")
    ego = log[(log["kind"] == "ego") & np.isclose(log["time_s"], flag)].iloc[0]
    place = np.array([ego["x_m"], ego["y_m"]])
    # the monitored lane surrounds the ego
    assert any((outline.min(0) <= place).all() and (place <= outline.max(0)).all() for _, outline in areas)


def test_equal_figures_give_equal_bytes(tmp_path: Path, finished: Finished) -> None:
    """Names inside an SVG file are random unless told otherwise; PNG and PDF: see test_cli.py."""
    (tmp_path / "one").mkdir()
    (tmp_path / "two").mkdir()
    one, two = (
        [
            p.read_bytes()
            for p in save_pictures(
                tmp_path / n, finished.runs, finished.logs, finished.site.network, finished.area, suffix="svg"
            )
        ]
        for n in ("one", "two")
    )
    assert one == two


def test_a_folder_that_is_gone_is_one_clear_error(tmp_path: Path, finished: Finished, drawn: Drawn) -> None:
    with pytest.raises(ArgumentError, match=r"cannot write .*speed_curves\.png: No such file or directory"):
        save_pictures(tmp_path / "gone", finished.runs, finished.logs, finished.site.network, finished.area)
    assert "birdseye" not in drawn.calls


@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_a_picture_is_written_as_a_whole_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    """On a full disk matplotlib leaves half a picture, and fails by itself where it writes PDF."""
    path = tmp_path / f"a.{suffix}"
    path.write_bytes(b"before")

    def full(part: Path, content: bytes) -> int:
        assert len(content) > 3
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ArgumentError, match=rf"a\.{suffix}: No space left on device; choose another place"):
        save_picture(plots.style.new_figure(1.0), path, "--png")
    assert path.read_bytes() == b"before"
    assert [file.name for file in tmp_path.iterdir()] == [path.name]


def test_names_with_dollar_signs_are_no_formulas(tmp_path: Path, finished: Finished) -> None:
    runs = finished.runs.assign(scenario=r"$\frac{$")
    written = save_pictures(tmp_path, runs, finished.logs, finished.site.network, None, suffix="svg")
    assert [path.stem for path in written] == ["speed_curves", "temporal_diagram", "birdseye"]


@pytest.mark.parametrize("strategy", ["rectangular", "map", "all"])
def test_map_with_each_strategy(tmp_path: Path, finished: Finished, strategy: str) -> None:
    path = tmp_path / "map.png"
    site = finished.site
    ego = EgoState(0.0, *site.route.pose(site.line_m), 50.0 / 3.6)
    save_map(site.network, path, make_strategy(strategy, named_preset("physical"), site), ego)
    assert path.stat().st_size > 1000


def test_map_without_a_place(tmp_path: Path, finished: Finished) -> None:
    save_map(finished.site.network, tmp_path / "map.SVG")
    assert "<svg" in (tmp_path / "map.SVG").read_text()


@pytest.mark.parametrize("name", ["map.bmp", "map"])
def test_map_in_an_unknown_format_is_refused(tmp_path: Path, finished: Finished, name: str) -> None:
    with pytest.raises(ArgumentError, match=r"--png: .*; the ending must be \.png, \.svg or \.pdf"):
        save_map(finished.site.network, tmp_path / name)
