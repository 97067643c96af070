"""What a tracker remembers between frames: a value that can be kept, copied and written to a file."""

from __future__ import annotations

import math
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from smartmot.arrays import shared_by_copies
from smartmot.errors import ConfigError, ShapeError
from smartmot.tracking.scores import ScoreScale
from smartmot.types import CATEGORIES, BoolArray, FloatArray, IntArray, seconds

COLUMNS = (
    "track_id",
    "category_code",
    "confirmed",
    "score",
    "score_sum",
    "hits",
    "birth_s",
    "matched_s",
    "inside_s",
    "existence",
    "front",
    *(f"evidence_{name}" for name in CATEGORIES),
)
"""What is known of a track besides its filter state. Times are stamps, `inside_s` that of the last time
inside the monitored area; `score_sum` and `hits` count the matched detections, each
by the trust in its detector. `front` is the evidence that
the object faces where its heading says and not backwards, `evidence_...` that for each category; both fade
with time. `existence` is the probability that there is an object; NaN where it is not estimated."""

ID, CODE, CONFIRMED, SCORE, SCORE_SUM, HITS, BIRTH_S, MATCHED_S, INSIDE_S, EXISTENCE, FRONT = range(11)
EVIDENCE = slice(FRONT + 1, len(COLUMNS))

FILE_VERSION = 1


@shared_by_copies
@dataclass(frozen=True, slots=True, eq=False)
class TrackerState:
    """All that the tracker remembers between frames.

    Args:
        stamp_s: Time of the last frame; None before the first.
        next_id: Identifier of the next track.
        rows: (M, R) what COLUMNS names.
        filtered: (M, W) filter states at stamp_s, see `smartmot.filters.kalman.BoxFilter`.
        scores: The detector's score scale, where the tracker estimates it.
        merged: Detections so far that started no track because they repeat another.

    Raises:
        ShapeError: The arrays do not have one row per track, a filter state is not finite, a category is
            unknown, or identifiers are not unique and less than the next.
        StampError: The stamp is not in seconds.
    """

    stamp_s: float | None
    next_id: int
    rows: FloatArray
    filtered: FloatArray
    scores: ScoreScale | None = None
    merged: int = 0

    def __post_init__(self) -> None:
        if self.stamp_s is not None:
            seconds(self.stamp_s, "tracker state")
        if self.rows.shape != (len(self.filtered), len(COLUMNS)) or self.filtered.ndim != 2:
            raise ShapeError(
                f"tracker state: expected (M, {len(COLUMNS)}) rows and (M, W) filter states, "
                f"got {self.rows.shape} and {self.filtered.shape}"
            )
        ids = self.rows[:, ID]
        if not (np.isfinite(ids).all() and np.isfinite(self.filtered).all()):
            raise ShapeError("tracker state: identifiers and filter states must be finite")
        if len(np.unique(ids)) < len(ids) or (len(ids) and ids.max() >= self.next_id):
            raise ShapeError("tracker state: identifiers must differ and be less than next_id")
        codes = self.rows[:, CODE]
        if not np.isin(codes, np.arange(len(CATEGORIES))).all():
            raise ShapeError(f"tracker state: category codes must lie in 0 ... {len(CATEGORIES) - 1}")
        self.rows.flags.writeable = False
        self.filtered.flags.writeable = False

    def __len__(self) -> int:
        return len(self.rows)

    @classmethod
    def empty(cls) -> TrackerState:
        """Before the first frame."""
        return cls(None, 1, np.zeros((0, len(COLUMNS))), np.zeros((0, 0)))

    @property
    def track_id(self) -> IntArray:
        """(M,) identifiers."""
        return self.rows[:, ID].astype(np.int64)

    @property
    def category_code(self) -> IntArray:
        """(M,) positions in CATEGORIES."""
        return self.rows[:, CODE].astype(np.int64)

    @property
    def confirmed(self) -> BoolArray:
        """(M,) flags."""
        return self.rows[:, CONFIRMED] > 0.0

    def save(self, path: str | Path) -> None:
        """Write the state to a file that `load` reads: NumPy's npz with plain arrays.

        Args:
            path: File to write, as named.
        """
        scores: dict[str, Any] = {}
        if self.scores is not None:
            scores = {
                "counted_s": np.array(self.scores.counted_s),
                "score_mass": self.scores.mass,
                "score_reference": self.scores.reference,
            }
        with Path(path).open("wb") as file:
            np.savez(
                file,
                version=np.array(FILE_VERSION),
                stamp_s=np.array(math.nan if self.stamp_s is None else self.stamp_s),
                next_id=np.array(self.next_id),
                rows=self.rows,
                filtered=self.filtered,
                merged=np.array(self.merged),
                **scores,
            )

    @classmethod
    def load(cls, path: str | Path) -> TrackerState:
        """State that `save` wrote. A tracker of the same configuration goes on from it as if never stopped.

        Args:
            path: The file.

        Returns:
            The state.

        Raises:
            ConfigError: The file is missing, is no tracker state, or is of another version.
        """
        try:
            with Path(path).open("rb") as file, np.load(file, allow_pickle=False) as data:
                version = int(data["version"])
                if version != FILE_VERSION:
                    raise ConfigError(
                        f"{path}: tracker state of version {version}, this release reads {FILE_VERSION}"
                    )
                stamp, rows, scores = float(data["stamp_s"]), np.array(data["rows"], dtype=np.float64), None
                if rows.ndim == 2 and rows.shape[1] == EXISTENCE:  # written before there was evidence
                    rows = np.hstack((rows, np.zeros((len(rows), len(COLUMNS) - FRONT))))
                if rows.ndim == 2 and rows.shape[1] == len(COLUMNS) - 1:  # before there was existence
                    rows = np.insert(rows, EXISTENCE, np.nan, axis=1)
                if "score_mass" in data:
                    mass, reference = (
                        np.array(data[name], dtype=np.float64) for name in ("score_mass", "score_reference")
                    )
                    scores = ScoreScale(float(data["counted_s"]), mass, reference)
                return cls(
                    None if math.isnan(stamp) else stamp,
                    int(data["next_id"]),
                    rows,
                    np.array(data["filtered"], dtype=np.float64),
                    scores,
                    int(data["merged"]) if "merged" in data else 0,
                )
        except ConfigError:
            raise
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise ConfigError(f"{path}: not a readable tracker state ({error})") from error
