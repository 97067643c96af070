"""Films of a tracked sequence, in the directory that a user names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from evaluation.errors import ArgumentError
from evaluation.results.files import check_writable
from evaluation.studies.mot.forecasts import Carry
from evaluation.studies.mot.tracking import TrackedSequence
from evaluation.views.film import maker
from evaluation.views.film.tracks import TracksDrawing, film_of

if TYPE_CHECKING:
    from scenarios.recorded.maps.drive_map import DriveMap


@dataclass(frozen=True, slots=True, eq=False)
class Film:
    """What to draw.

    Args:
        tracked: The sequence and its tracks.
        carry: The forecast.
        frames: Which frames.
        network: The map, drawn below everything; or None.
    """

    tracked: TrackedSequence
    carry: Carry
    frames: range
    network: DriveMap | None = None

    def write(self, path: Path, option: str, done: Callable[[], None] = lambda: None) -> None:
        """Draw the frames and write them, in a new folder if need be.

        Args:
            path: The file.
            option: `--gif` for an animated GIF that plays in real time, `--video` for an MP4 at the mean
                frame rate of the sequence.
            done: Called after each picture.

        Raises:
            ArgumentError: There is no ffmpeg, or the file cannot be written.
        """
        sequence, tracked = self.tracked.sequence, self.tracked
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            check_writable(path)
            drawing = TracksDrawing(sequence, tracked.tracks, partial(self.carry, tracked), self.network)
            film = film_of(drawing, self.frames, sequence.stamp_s[self.frames.start : self.frames.stop])
            maker.write(path, film, option, done)
        except OSError as error:
            raise ArgumentError(f"{option}: cannot write {path}: {error.strerror or error}") from None
