"""What docs/scale.md says of a million runs is computed from the file that the benchmark wrote."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from benchmarks import scale_out
from benchmarks.scale_out import PAGE, measured, overheads, page_with, section

MEASURED: dict[str, Any] = {
    "runs": 1000, "few": 200, "alone_wall_s": 0.1, "alone_cpu_s": 0.09, "load": 1.0, "cores": 2,
    "results": {
        "pool_1": {
            "few": {"wall_s": 30.0, "first_result_s": 2.0, "runs_wall_s": 20.0, "runs_cpu_s": 18.0,
                    "caller_cpu_s": 0.0, "all_cpu_s": 21.0, "journal_bytes": 80_000},
            "all": {"wall_s": 110.0, "first_result_s": 2.0, "runs_wall_s": 100.0, "runs_cpu_s": 90.0,
                    "caller_cpu_s": 0.0, "all_cpu_s": 97.0, "journal_bytes": 400_000, "held_bytes": 1.2e6},
        },
        "scheduler_2": {
            "few": {"wall_s": 15.0, "first_result_s": 4.0, "runs_wall_s": 20.0, "runs_cpu_s": 18.0,
                    "caller_cpu_s": 1.0, "all_cpu_s": 24.0, "journal_bytes": 80_000},
            "all": {"wall_s": 60.0, "first_result_s": 4.0, "runs_wall_s": 100.0, "runs_cpu_s": 90.0,
                    "caller_cpu_s": 2.2, "all_cpu_s": 104.0, "journal_bytes": 400_000, "held_bytes": 1.2e6},
        },
    },
}  # fmt: skip


def test_overheads_are_the_slope_over_the_runs_and_what_is_there_without_any() -> None:
    """By hand: 6 s beside 200 runs and 14 s beside 1000 are 10 ms each, and 4 s before the first."""
    costs = overheads(MEASURED, "scheduler_2")
    assert costs["per_run_s"] == pytest.approx(0.01)
    assert costs["start_s"] == pytest.approx(4.0)
    assert costs["caller_s"] == pytest.approx(0.0015)
    assert costs["efficiency"] == pytest.approx(100.0 / 120.0)
    assert costs["busy"] == pytest.approx(100.0 / 120.0)
    assert costs["busy_started"] == pytest.approx(100.0 / 112.0)


def test_parts_are_measured_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Stopped after the first part, the benchmark goes on with the second; other code begins anew."""
    carried_out: list[int] = []

    def measure(runs: list[int], workers: int, processes: list[int]) -> tuple[dict[str, float], list[Any]]:
        assert not processes
        carried_out.append(workers)
        if workers == 2 and carried_out == [1, 1, 2]:
            raise KeyboardInterrupt
        return dict(MEASURED["results"]["pool_1"]["all"]), []

    monkeypatch.setattr(scale_out, "specs", lambda count: list(range(count)))
    monkeypatch.setattr(scale_out, "timed", lambda spec: (None, None, 0.1, 0.09))
    monkeypatch.setattr(scale_out, "measure", measure)
    out = tmp_path / "scale_out.json"
    with pytest.raises(KeyboardInterrupt):
        scale_out.run_benchmark(20, ["pool_1", "pool_2"], out)
    scale_out.run_benchmark(20, ["pool_1", "pool_2"], out)
    assert carried_out == [1, 1, 2, 2, 2]
    assert list(json.loads(out.read_text())["results"]) == ["pool_1", "pool_2"]
    monkeypatch.setattr(scale_out, "made_with", lambda count: {"commit": "another"})
    scale_out.run_benchmark(20, ["pool_1"], out)
    assert carried_out[5:] == [1, 1]
    assert list(json.loads(out.read_text())["results"]) == ["pool_1"]


def test_a_million_runs_by_hand() -> None:
    """0.1 s each: 27.8 hours; 90 ms of work for 1.5 ms of the caller: 60 workers; 400 bytes: 0.4 GB."""
    text = section(MEASURED)
    for said in (
        "28 hours of one core, 10.0 %",
        "16 workers 1.7 hours",
        "60 workers at most",
        "0.40 GB",
        "1.2 GB",
    ):
        assert said in text
    assert "64 workers" not in text  # more than the caller keeps up with


def test_the_page_has_what_the_file_says() -> None:
    text = PAGE.read_text()
    assert page_with(text, measured()) == text
