"""Tables in Feather files, read with the checks that tables of text have."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios import reading
from scenarios.errors import DatasetError
from scenarios.recorded.textfile import MAX_ROWS, TextTable

LONGEST_TEXT = 200
"""Characters of a name; every row of a column takes as much memory as its longest."""


def read_feather(
    path: Path, numbers: Collection[str], integers: Collection[str] = (), texts: Collection[str] = ()
) -> TextTable:
    """Read columns of a Feather file; the lines of the table are its rows, from 1.

    Args:
        path: The file.
        numbers: Columns that are read as float64; what is missing in them is NaN.
        integers: Columns that are read as int64.
        texts: Columns that hold texts.

    Raises:
        DatasetError: The file cannot be read, a column is missing, or holds something else.
    """
    import pyarrow as pa  # type: ignore[import-untyped]

    if not path.is_file():
        raise DatasetError(f"{path}: no such file; for the folder's layout see docs/formats.md")
    kinds = {**dict.fromkeys(numbers, pa.float64()), **dict.fromkeys(integers, pa.int64())}
    kinds |= dict.fromkeys(texts, pa.string())
    try:
        table = _table(path, kinds)
    except DatasetError:
        raise
    except (OSError, ValueError, MemoryError, pa.ArrowException) as error:
        raise DatasetError(
            f"{path}: not a readable Feather file ({reading.shown(str(error))}); copy it again"
        ) from None
    columns: dict[str, NDArray[Any]] = {}
    for name, kind in kinds.items():
        column = table.column(name)
        try:
            column = column.cast(kind)
        except (pa.ArrowException, ValueError) as error:
            raise DatasetError(
                f"{path}: column {name!r} must hold {kind} ({reading.shown(str(error))})"
            ) from None
        if kind != pa.float64() and column.null_count:
            row = int(np.argmax(column.is_null().to_numpy())) + 1
            raise DatasetError(f"{path}:{row}: field {name!r} is missing")
        columns[name] = _texts(path, name, column) if kind == pa.string() else column.to_numpy()
    return TextTable(path, np.arange(1, table.num_rows + 1, dtype=np.int64), columns)


def _table(path: Path, needed: Collection[str]) -> Any:
    """The needed columns of a file, batch by batch: a file of some bytes can claim any number of rows."""
    import pyarrow as pa

    with pa.OSFile(str(path)) as file:
        names = pa.ipc.open_file(file).schema.names
        missing = [name for name in needed if name not in names]
        if missing:
            raise DatasetError(f"{path}: columns missing: {', '.join(missing)} (see docs/formats.md)")
        for name in needed:
            if names.count(name) > 1:
                raise DatasetError(f"{path}: column {name!r} is there twice")
        options = pa.ipc.IpcReadOptions(included_fields=sorted(map(names.index, needed)))
        reader = pa.ipc.open_file(file, options=options)
        batches: list[Any] = []
        for k in range(reader.num_record_batches):
            batches.append(reader.get_batch(k))
            if sum(batch.num_rows for batch in batches) > MAX_ROWS:
                raise DatasetError(f"{path}: more than {MAX_ROWS} rows")
        table = pa.Table.from_batches(batches, reader.schema)
        table.validate(full=True)  # damaged offsets lead out of the file
        return table


def _texts(path: Path, name: str, column: Any) -> NDArray[Any]:
    """(K,) texts of a column, each of which is there many times."""
    encoded = column.combine_chunks().dictionary_encode()
    texts, index = encoded.dictionary.to_pylist(), encoded.indices.to_numpy()
    if any(len(text) > LONGEST_TEXT for text in texts):
        row = int(np.argmax(np.array([len(text) > LONGEST_TEXT for text in texts])[index])) + 1
        raise DatasetError(f"{path}:{row}: field {name!r} must have {LONGEST_TEXT} characters or fewer")
    made: NDArray[Any] = np.array(texts, dtype=np.str_)[index]
    return made
