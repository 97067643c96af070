"""Rows of runs of one or more folders of results as partitioned Parquet, for DuckDB, pandas and others.

Rows are read and written some thousands at a time: a million runs need no more memory than a few.
"""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evaluation.errors import ArgumentError
from evaluation.results.files import RUNS_CSV, ResultsError, one_line
from evaluation.results.rows import RunRow
from evaluation.runs.journal import RUNS, kept_lines
from evaluation.studies.answers.lidar.runs import LidarDecision
from evaluation.studies.compare.measures import RunMeasures
from evaluation.studies.drive.measures import LoggedRow
from evaluation.studies.growth import GrowthRun
from evaluation.studies.reference.mechanisms import MechanismRun

if TYPE_CHECKING:
    import pyarrow as pa  # type: ignore[import-untyped]

TABLES = (RUNS_CSV, f"{RUNS_CSV}.gz")
FOLDER = "folder"
"""Column with the name of the folder that a row is from."""
KINDS = (RunRow, RunMeasures, LidarDecision, LoggedRow, GrowthRun, MechanismRun)
"""What the tables of runs hold; a name means the same, with the same type, in all of them."""
ROWS_AT_ONCE = 5_000
USUAL = ("strategy",)
"""What rows are parted by unless it is said."""
BYTES_AT_ONCE = 4 << 20


def write_parquet(folders: Sequence[Path], out: Path, by: Sequence[str] | None = None) -> int:
    """Write the rows of folders of results as Parquet, in folders by the values of some columns.

    A folder's table is `runs.csv`, `runs.csv.gz` or, where that is not written yet, its journal.

    Args:
        folders: of results, with the same columns.
        out: folder, which must not exist.
        by: columns whose values make folders, `strategy=map` and so on; None: `strategy`, where there is one.

    Returns:
        How many rows there are.

    Raises:
        ArgumentError: `out` exists, the folders have other columns than one another, or none to part by.
        ResultsError: there are no rows, a table cannot be read, or `out` cannot be written.
    """
    import pyarrow as pa
    import pyarrow.dataset  # type: ignore[import-untyped]

    if out.exists():
        raise ArgumentError(f"--parquet: {out} is there already; name another folder or remove it")
    sources = {folder: _source(folder) for folder in folders}
    headers = {folder: _columns(source) for folder, source in sources.items()}
    names = headers[folders[0]]
    for folder, other in headers.items():
        if other != names:
            raise ArgumentError(f"{folder}: has other columns than {folders[0]}; write them apart")
    if by is None:
        by = tuple(name for name in USUAL if name in names)
    for name in by:
        if name not in names:
            raise ArgumentError(f"--by: no column {name!r}; there are: {', '.join(names)}")
    schema = pa.schema([(FOLDER, pa.string()), *((name, _type(name)) for name in names)])
    part = out.with_name(f".{out.name}.part")
    count = 0

    def batches() -> Iterator[pa.RecordBatch]:
        nonlocal count
        for folder, source in sources.items():
            for batch in _batches(source, schema):
                column = pa.array([folder.resolve().name] * len(batch), pa.string())
                count += len(batch)
                yield pa.RecordBatch.from_arrays([column, *batch.columns], schema=schema)

    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(part, ignore_errors=True)
        pa.dataset.write_dataset(
            batches(),
            part,
            schema=schema,
            format="parquet",
            partitioning=pa.dataset.partitioning(pa.schema([schema.field(n) for n in by]), flavor="hive"),
            use_threads=False,  # the same rows make the same files
        )
        if not count:
            raise ResultsError(f"{folders[0]}: has no run")
        part.rename(out)
    except OSError as error:
        raise ResultsError(f"{out}: cannot be written ({error.strerror or one_line(error)})") from None
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return count


def _source(folder: Path) -> Path:
    """The table of a folder, or the journal of one that has none yet."""
    for name in TABLES:
        if (folder / name).is_file():
            return folder / name
    journals = sorted(folder.glob(f"*{RUNS}"))
    if len(journals) == 1:
        return journals[0]
    if journals:
        names = ", ".join(path.name for path in journals)
        raise ResultsError(f"{folder}: has several journals and no {RUNS_CSV} ({names})")
    raise ResultsError(f"{folder}: no {RUNS_CSV}, {TABLES[1]} or journal; name a folder of results")


def _columns(source: Path) -> tuple[str, ...]:
    """Names of the columns of a table."""
    if source.name.endswith(RUNS):
        _, values = next(kept_lines(source), ("", {}))
        return tuple(values)
    return tuple(_reader(source, {}).schema.names)


def _type(name: str) -> pa.DataType:
    """What a column holds; of an unknown one texts."""
    import pyarrow as pa

    types = {"str": pa.string(), "int": pa.int64(), "float": pa.float64(), "bool": pa.bool_()}
    return types[column_kinds().get(name, "str")]


def column_kinds() -> dict[str, str]:
    """Python's types of all columns that tables of runs have, by their names."""
    fields = (field for kind in KINDS for field in dataclasses.fields(kind))
    return {field.name: str(field.type).removesuffix(" | None") for field in fields}


def _batches(source: Path, schema: pa.Schema) -> Iterator[pa.RecordBatch]:
    """Rows of a table, some at a time, without the column of the folder.

    Raises:
        ResultsError: the table cannot be read.
    """
    import pyarrow as pa

    of_table = schema.remove(0)
    try:
        if source.name.endswith(RUNS):
            rows: list[Mapping[str, Any]] = []
            for _, values in kept_lines(source):
                rows.append(values)
                if len(rows) == ROWS_AT_ONCE:
                    yield pa.RecordBatch.from_pylist(rows, schema=of_table)
                    rows = []
            if rows:
                yield pa.RecordBatch.from_pylist(rows, schema=of_table)
        else:
            yield from _reader(source, {field.name: field.type for field in of_table})
    except (pa.ArrowInvalid, pa.ArrowTypeError, UnicodeDecodeError, EOFError) as error:
        raise ResultsError(f"{source}: not a readable table of runs ({one_line(error)})") from None


def _reader(source: Path, types: Mapping[str, pa.DataType]) -> Any:
    """Reads a table in CSV, block by block.

    Raises:
        ResultsError: it is empty, or none.
    """
    import pyarrow as pa
    import pyarrow.csv  # type: ignore[import-untyped]

    try:
        return pa.csv.open_csv(
            pa.input_stream(source, compression="gzip" if source.suffix == ".gz" else None),
            read_options=pa.csv.ReadOptions(block_size=BYTES_AT_ONCE),
            convert_options=pa.csv.ConvertOptions(
                column_types=dict(types), null_values=[""], strings_can_be_null=True
            ),
        )
    except (pa.ArrowInvalid, OSError) as error:
        raise ResultsError(f"{source}: not a readable table of runs ({one_line(error)})") from None
