"""Runs of a folder as recordings."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.results.files import ResultsError
from evaluation.results.logs import LOG_COLUMNS, read_log, write_log
from evaluation.runs import recordings
from evaluation.runs.recordings import recording_of_run, recordings_of_runs

GOOD = Path(__file__).parents[2] / "data" / "field" / "runs" / "good"
RUN = "cpna_paper_map_dry_none_50kmh_seed0"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return Path(shutil.copytree(GOOD, tmp_path / "runs"))


def test_the_list_of_runs_is_read_once_for_all(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It has all runs: read for each of them, a folder of thousands would take hours."""
    reads: list[Path] = []
    read = recordings.read_configuration
    monkeypatch.setattr(recordings, "read_configuration", lambda path: reads.append(path) or read(path))
    for k in range(3):
        shutil.copy(folder / "logs" / f"{RUN}.parquet", folder / "logs" / f"copy{k}.parquet")
    listed, *strange = recordings_of_runs(folder, [RUN, "copy0", "copy1", "copy2"])
    assert reads == [folder]
    alone = recording_of_run(folder / RUN)
    assert (listed.map_path, listed.notes, len(listed.others)) == (
        alone.map_path,
        alone.notes,
        len(alone.others),
    )
    assert np.array_equal(listed.sequence.stamp_s, alone.sequence.stamp_s)
    for each in strange:
        assert each.others == ()
        assert each.notes[0].startswith("Map and names are not known: ")


def test_an_actor_that_the_scenario_does_not_have_is_refused(folder: Path) -> None:
    path = folder / "logs" / f"{RUN}.parquet"
    if not recording_of_run(folder / RUN).others:
        pytest.skip("the scenario of the run is not known")
    log = read_log(path)
    log.loc[log["kind"] == "actor", "id"] = 99
    texts = ("kind", "category", "label")
    columns = {
        name: log[name].fillna("").to_numpy(object) if name in texts else log[name].to_numpy(np.float64)
        for name in LOG_COLUMNS
    }
    write_log(path, columns)
    assert set(pd.read_parquet(path)["id"].dropna()) >= {99}
    with pytest.raises(ResultsError, match=f"log {RUN}: actor 99 is none of the scenario's"):
        recording_of_run(folder / RUN)
