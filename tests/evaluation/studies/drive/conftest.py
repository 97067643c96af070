"""Recorded drives made by hand, and the command that drives them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from evaluation.cli.entry import main

HEADER = "stamp_s,x_m,y_m,length_m,width_m,yaw_rad,category,score"
SPEED_MPS = 10.0
STREET = Path(__file__).parents[4] / "scenarios" / "maps" / "urban_street.xodr"
Write = Callable[..., Path]


@dataclass(frozen=True)
class Done:
    """A finished command."""

    status: int
    out: str
    err: str


def written(
    folder: Path,
    persons: list[tuple[float, float]],
    seconds: float = 20.0,
    labelled: bool = True,
    detected: bool = True,
    y_m: float = 0.0,
) -> Path:
    """CSV files of an ego at 10 m/s along x, from 100 m on, and of persons who stand.

    Persons are given by how far they are ahead of the start and to its left.
    """
    folder.mkdir(parents=True, exist_ok=True)
    times = [k / 10 for k in range(round(seconds * 10) + 1)]
    rows = [f"{t:.1f},{x + 100},{y + y_m},0.6,0.6,0,pedestrian,0.9" for t in times for x, y in persons]
    (folder / "detections.csv").write_text("\n".join([HEADER, *(rows if detected else [])]) + "\n")
    ego = [f"{t:.1f},{100 + SPEED_MPS * t:.3f},{y_m},0" for t in times]
    (folder / "ego.csv").write_text("\n".join(["stamp_s,x_m,y_m,yaw_rad", *ego]) + "\n")
    if labelled:
        numbered = [f"{row},{k % max(len(persons), 1)}" for k, row in enumerate(rows)]
        (folder / "labels.csv").write_text("\n".join([f"{HEADER},track_id", *numbered]) + "\n")
    return folder


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes a recording; see `written`."""

    def make(persons: list[tuple[float, float]], name: str = "data", **rest: object) -> Path:
        return written(tmp_path / name, persons, **rest)  # type: ignore[arg-type]

    return make


@pytest.fixture(scope="session")
def driven(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder `data` with a drive of 6 s over a labelled person on the shipped street, and `out` of it."""
    root = tmp_path_factory.mktemp("driven")
    data = written(root / "data", [(50.0, 0.0)], seconds=6.0, y_m=-1.75)
    with pytest.MonkeyPatch.context() as patch:
        asked = ("--strategy", "map,path", "--map", STREET, "--preset", "physical", "--quiet")
        patch.setattr(
            sys, "argv", ["smartmot-eval", "drive", *map(str, (data, "--out", root / "out", *asked))]
        )
        with pytest.raises(SystemExit) as stop:
            main()
    assert not stop.value.code
    return root


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Callable[..., Done]:
    """Runs `smartmot-eval` in this process."""

    def call(*arguments: object) -> Done:
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
        status = 0
        try:
            main()
        except SystemExit as stop:
            status = int(stop.code or 0)
        printed = capsys.readouterr()
        return Done(status, printed.out, printed.err)

    return call
