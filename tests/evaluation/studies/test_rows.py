"""Rows of runs as Parquet: the same values in the types of their columns, and the queries of the page."""

from __future__ import annotations

import dataclasses
import gzip
import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow.parquet as pq
import pytest

from evaluation.cli import main
from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError
from evaluation.runs.execution import FrameTime
from evaluation.runs.journal import RUNS, Journal
from evaluation.studies import rows as rows_module
from evaluation.studies.compare.measures import RunMeasures
from evaluation.studies.compare.table import runs_csv
from evaluation.studies.rows import KINDS, column_kinds, write_parquet

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "queries.md"
REPORTS = ROOT / "reports"


def run(strategy: str, must: str, variant: str, collided: bool, seed: int = 0) -> RunMeasures:
    return RunMeasures(
        scene="crosses", variant=variant, must=must, strategy=strategy, settings="way=path",
        preset="physical", weather="dry", seed=seed, v_test_kmh=50.0, collided=collided,
        v_impact_kmh=30.0 if collided else 0.0,
        score=None, band=None, flag_time_s=None if collided else 1.25, flag_distance_m=None,
        flag_ttc_s=None if collided else 1.5, end_reason="contact" if collided else "stopped",
        false_activation=None if must == "brake" else variant == "b", needless_stop=variant == "b",
        speed_loss_kmh=0.1 + 0.2, delay_s=0.0, distance_m=3.0, duration_s=2.0, detections_mean=1.0,
        tracks_mean=1.0, dropped_share=0.0, min_ttc_s=None, max_btn=0.5,
    )  # fmt: skip


RUNS_OF_TWO = [
    run("map", "brake", "a", collided=True),
    run("map", "brake", "b", collided=False),
    run("map", "nothing", "b", collided=False),
    run("all", "brake", "a", collided=False),
    run("all", "brake", "b", collided=False),
    run("all", "nothing", "c", collided=False),
]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the table of a comparison, which is the current one's neighbour."""
    monkeypatch.chdir(tmp_path)
    out = tmp_path / "compare"
    out.mkdir()
    (out / "runs.csv").write_bytes(runs_csv(RUNS_OF_TWO))
    return out


def records(out: Path) -> list[dict[str, Any]]:
    """Rows of a folder of Parquet in a fixed order, without the name of the folder."""
    table = pq.read_table(out)
    listed = [{k: v for k, v in row.items() if k != "folder"} for row in table.to_pylist()]
    return sorted(listed, key=lambda row: (row["strategy"], row["must"], row["variant"], row["seed"]))


def expected(runs: list[RunMeasures]) -> list[dict[str, Any]]:
    ordered = sorted(runs, key=lambda kept: (kept.strategy, kept.must, kept.variant, kept.seed))
    return [dataclasses.asdict(kept) for kept in ordered]


def test_rows_are_what_the_runs_came_to_to_the_last_digit(folder: Path) -> None:
    assert write_parquet([folder], Path("rows")) == 6
    assert records(Path("rows")) == expected(RUNS_OF_TWO)
    assert sorted(path.name for path in Path("rows").iterdir()) == ["strategy=all", "strategy=map"]
    assert set(pq.read_table("rows")["folder"].to_pylist()) == {"compare"}


@pytest.mark.parametrize("at_once", [2, 100])
def test_a_journal_gives_the_rows_that_the_table_will_have(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, at_once: int
) -> None:
    monkeypatch.setattr(rows_module, "ROWS_AT_ONCE", at_once)
    with Journal(tmp_path / "at_work", RunMeasures) as journal:
        for number, kept in enumerate(RUNS_OF_TWO):
            journal.add(f"{number:024x}", kept, FrameTime(1, 1.0, 1.0))
    with (tmp_path / "at_work" / RUNS).open("ab") as file:
        file.write(b'{"key": "00ab", "sce')  # a run that is just being written
    assert write_parquet([tmp_path / "at_work"], tmp_path / "rows", ("strategy", "must")) == 6
    assert records(tmp_path / "rows") == expected(RUNS_OF_TWO)


def test_several_folders_compressed_or_not_become_one(folder: Path) -> None:
    other = folder.with_name("seed_1")
    other.mkdir()
    further = [dataclasses.replace(kept, seed=1) for kept in RUNS_OF_TWO]
    (other / "runs.csv.gz").write_bytes(gzip.compress(runs_csv(further)))
    main_ended(["rows", "compare", "seed_1", "--parquet", "rows", "--by", "scene,strategy"])
    assert records(Path("rows")) == expected([*RUNS_OF_TWO, *further])
    table = pq.read_table("rows")
    assert {(row["folder"], row["seed"]) for row in table.to_pylist()} == {("compare", 0), ("seed_1", 1)}


def test_a_column_is_of_its_type_where_no_row_has_a_value(folder: Path) -> None:
    write_parquet([folder], Path("rows"))
    (file,) = Path("rows/strategy=map").iterdir()
    types = {field.name: str(field.type) for field in pq.read_schema(file)}
    assert (types["score"], types["band"], types["seed"]) == ("double", "string", "int64")
    assert types["false_activation"] == "bool"


def test_a_name_is_of_one_type_in_all_tables() -> None:
    kinds = column_kinds()
    for kind in KINDS:
        for field in dataclasses.fields(kind):
            assert str(field.type).removesuffix(" | None") == kinds[field.name], (kind, field.name)
    assert set(kinds.values()) == {"str", "int", "float", "bool"}


@pytest.mark.parametrize("name", ["frontier_physical", "gain", "mechanisms", "paper", "drives"])
def test_the_tables_of_the_reference_results_are_read(tmp_path: Path, name: str) -> None:
    place = REPORTS / name
    if not any((place / table).is_file() for table in rows_module.TABLES):
        place = next(path.parent for path in sorted(place.rglob("runs.csv*")))
    count = write_parquet([place], tmp_path / "rows", ())
    table = next(path for name in rows_module.TABLES if (path := place / name).is_file())
    whole = pd.read_csv(table, keep_default_na=False, na_values=[""], low_memory=False)
    assert count == len(whole) == pq.read_table(tmp_path / "rows").num_rows
    (speed,) = [column for column in ("v_impact_kmh",) if column in whole] or [None]
    if speed:
        assert pq.read_table(tmp_path / "rows")[speed].to_pandas().sum() == pytest.approx(whole[speed].sum())


def main_ended(words: list[str]) -> None:

    before = sys.argv
    sys.argv = ["smartmot-eval", *words]
    try:
        with pytest.raises(SystemExit) as stop:
            main()
    finally:
        sys.argv = before
    assert not stop.value.code


def test_the_queries_of_the_page_run(folder: Path) -> None:
    duckdb = pytest.importorskip("duckdb", reason="needs duckdb")
    write_parquet([folder], Path("rows"))
    per_side, lost, quantiles = re.findall(r"```sql\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    assert duckdb.sql(per_side).fetchall() == [
        ("all", "way=path", 2, 1.0, 0, None),
        ("map", "way=path", 2, 0.5, 1, 30.0),
    ]
    assert duckdb.sql(lost).fetchall() == [("a", "way=path", 0, 30.0, "all")]
    assert duckdb.sql(quantiles).fetchall() == [("crosses", [1.5, 1.5, 1.5], 2)]
    (python,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    names: dict[str, Any] = {}
    exec(python, names)
    assert len(names["brake"]) == 4
    assert names["nothing"]["false_activation"].tolist() == [True]


MANY = 200_000
_STREAMS = """
import resource, sys
from pathlib import Path
import pyarrow.csv, pyarrow.dataset, pyarrow.parquet
from evaluation.studies.rows import write_parquet

def used() -> int:
    return int(next(l for l in open("/proc/self/status") if l.startswith("VmData")).split()[1]) << 10

write_parquet([Path("few")], Path("warm"))  # what is loaded and started at the first call
limit = used() + int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_DATA, (limit, limit))
print(write_parquet([Path("many")], Path("rows"), ("strategy", "must")))
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs the limits of Linux")
def test_rows_of_a_journal_larger_than_the_memory_pass_through(tmp_path: Path) -> None:
    line = json.dumps({"key": "0", **dataclasses.asdict(RUNS_OF_TWO[0])})
    for name, count in (("few", 10), ("many", MANY)):
        (tmp_path / name).mkdir()
        with (tmp_path / name / RUNS).open("w") as journal:
            for number in range(count):
                strategy = ("map", "all")[number % 2]
                own = line.replace('"key": "0"', f'"key": "{number:024x}"')
                journal.write(own.replace('"strategy": "map"', f'"strategy": "{strategy}"') + "\n")
    limit = 64 << 20
    assert (tmp_path / "many" / RUNS).stat().st_size > 1.5 * limit
    words = [sys.executable, "-c", _STREAMS, str(limit)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, f"{MANY}\n"), done.stderr
    table = pq.read_table(tmp_path / "rows", columns=["strategy", "speed_loss_kmh"])
    assert len(table) == MANY
    assert table["strategy"].to_pylist().count("all") == MANY // 2
    assert set(table["speed_loss_kmh"].to_pylist()) == {0.1 + 0.2}


def test_what_cannot_be_done_is_said_and_nothing_is_left(folder: Path) -> None:
    other = folder.with_name("other")
    other.mkdir()
    with pytest.raises(ResultsError, match=r"other: no runs\.csv, runs\.csv\.gz or journal"):
        write_parquet([other], Path("rows"))
    (other / "runs.csv").write_text("a,b\n1,2\n")
    with pytest.raises(ArgumentError, match="other: has other columns than"):
        write_parquet([folder, other], Path("rows"))
    with pytest.raises(ArgumentError, match="--by: no column 'speed'; there are: scene, variant, "):
        write_parquet([folder], Path("rows"), ("speed",))
    content = (folder / "runs.csv").read_text()
    (folder / "runs.csv").write_text(content.replace("50.0", "fast"))
    with pytest.raises(ResultsError, match=r"runs\.csv: not a readable table of runs \(.*fast"):
        write_parquet([folder], Path("rows"))
    (folder / "runs.csv").write_text("")
    with pytest.raises(ResultsError, match=r"runs\.csv: not a readable table of runs"):
        write_parquet([folder], Path("rows"))
    (folder / "runs.csv").write_text(content.splitlines()[0] + "\n")
    with pytest.raises(ResultsError, match="compare: has no run"):
        write_parquet([folder], Path("rows"))
    Path("rows").mkdir()
    with pytest.raises(ArgumentError, match="--parquet: rows is there already"):
        write_parquet([folder], Path("rows"))
    assert sorted(path.name for path in folder.parent.iterdir()) == ["compare", "other", "rows"]
