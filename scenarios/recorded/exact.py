"""Numbers read from text as they were written."""

from __future__ import annotations

from typing import Any


def exact_floats() -> dict[str, Any]:
    """Argument of `pandas.read_csv` for floats without rounding errors.

    From version 3 on, pandas reads them so anyway, and warns of the argument.
    """
    import pandas as pd

    return {} if int(pd.__version__.partition(".")[0]) >= 3 else {"float_precision": "round_trip"}
