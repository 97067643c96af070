"""The benchmark of drives, on a log of a second."""

from pathlib import Path

import pytest

from benchmarks.drives import bench
from tests.scenarios.recorded import argoverse_log


def test_every_part_has_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ratio = bench(argoverse_log.log(tmp_path / "log"), ("map", "path"), ("paper",), repeats=1)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "log: 10 frames, 0.9 s recorded"
    parts = [" ".join(line.split()[:-6]) for line in lines[1:]]
    assert parts == ["reading", "map, paper", "path, paper", "writing of a log", "all parts on"]
    times = [float(line.split()[-6]) for line in lines[1:]]
    assert times[-1] == pytest.approx(times[0] + max(times[1:3]) + times[3], abs=0.003)
    assert ratio == pytest.approx(0.9 / times[-1], rel=0.02)
