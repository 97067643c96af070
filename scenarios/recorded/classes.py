"""Names of classes as the tracker's categories: each format's own, and the user's in `classes.csv`.

The file, beside the detections or in the data's folder, has a header and two columns::

    class,category
    van,car
    rider,cyclist
    traffic_sign,

Its rows overrule and extend the format's own names. A class without category is left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from scenarios.reading import shown
from scenarios.recorded.dataset import LEFT_OUT
from scenarios.recorded.textfile import TextTable, is_given, read_headed_table
from smartmot.types import CATEGORIES, StrArray

CLASSES_CSV = "classes.csv"
_SHOWN_CLASSES, _SHOWN_LETTERS = 8, 30
ClassMap = Mapping[str, str]
"""Category, or LEFT_OUT, of each class."""


def read_classes(folder: Path, own: ClassMap) -> ClassMap:
    """The format's own classes with those of the user's file, if there is one.

    Args:
        folder: Where `classes.csv` may be.
        own: Classes of the format.

    Raises:
        DatasetError: The file is wrong; the message names file, line and field.
    """
    path = folder / CLASSES_CSV
    if not is_given(path):
        return own
    table = read_headed_table(path, ("class", "category"), ())
    allowed = (*CATEGORIES, LEFT_OUT)
    table.require(
        np.isin(table["category"], allowed), "category", f"must be empty or one of {', '.join(CATEGORIES)}"
    )
    return {**own, **dict(zip(table["class"].tolist(), table["category"].tolist(), strict=True))}


def most_common(counts: Mapping[str, int], none: str) -> str:
    """Classes of boxes with their numbers, most first, for a note: a few of them, in one line.

    Args:
        counts: boxes by class.
        none: what stands for the class "".
    """
    ordered = sorted(counts.items(), key=lambda item: (-item[1], item[0]))
    more = ordered[_SHOWN_CLASSES:]
    listed = [f"{number} {_short(name) or none}" for name, number in ordered[:_SHOWN_CLASSES]]
    if more:
        listed.append(f"{sum(number for _, number in more)} of {len(more)} more classes")
    return ", ".join(listed)


def _short(name: str) -> str:
    return name if name.isprintable() and len(name) <= _SHOWN_LETTERS else shown(name)


def require_categories(table: TextTable, name: str, classes: ClassMap, rule: str) -> StrArray:
    """(K,) categories of a table's rows by their column of classes.

    Raises:
        DatasetError: A class has no category; the message names file, line and field, and the rule.
    """
    table.require(np.isin(table[name], list(classes)), name, rule)
    return categories(table[name], classes)


def categories(names: Iterable[str], classes: ClassMap) -> StrArray:
    """(K,) categories of K classes, LEFT_OUT where they have none.

    Args:
        names: Classes, all of them known.
        classes: What they mean.
    """
    unique, inverse = np.unique(np.asarray(names, dtype=np.str_), return_inverse=True)
    return np.array([classes[name] for name in unique.tolist()], dtype=np.str_)[inverse]
