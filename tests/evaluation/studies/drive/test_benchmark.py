"""The benchmark of drives, on a log of a second."""

from pathlib import Path

import pytest

from benchmarks.drives import bench
from tests.scenarios.recorded import argoverse_log


def test_every_drive_has_its_line_with_all_parts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ratio = bench(argoverse_log.log(tmp_path / "log"), ("map", "path"), ("paper",), repeats=1)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "log: 10 frames, 0.9 s recorded"
    drives = [line.split() for line in lines[2:4]]
    assert [" ".join(words[:2]) for words in drives] == ["map, paper", "path, paper"]
    for words in drives:
        reading_s, drive_s, writing_s, all_s = (float(word) for word in words[2:10:2])
        assert all_s == pytest.approx(reading_s + drive_s + writing_s, abs=0.003)
        assert float(words[10]) == pytest.approx(0.9 / all_s, rel=0.02)
    slowest = min(drives, key=lambda words: float(words[10]))
    assert ratio == pytest.approx(float(slowest[10]), abs=0.051)
    sentence = f"20 times faster than real time with all parts on: {ratio:.1f} times with {slowest[0]} paper"
    assert f"{'at least' if ratio >= 20.0 else 'less than'} {sentence}" in lines[4]
