"""Films of a tracked sequence, in the directory that a user names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from evaluation.errors import ArgumentError
from evaluation.studies.mot.forecasts import Carry
from evaluation.studies.mot.tracking import TrackedSequence
from evaluation.views.film import maker
from evaluation.views.film.tracks import TracksDrawing, film_of

if TYPE_CHECKING:
    from opendrive import RoadNetwork


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
    network: RoadNetwork | None = None

    def write(self, path: Path, option: str, done: Callable[[], None]) -> None:
        """Draw the frames and write them, in a new folder if need be.

        Raises:
            ArgumentError: There is no ffmpeg, or the file cannot be written.
        """
        sequence, tracked = self.tracked.sequence, self.tracked
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            drawing = TracksDrawing(sequence, tracked.tracks, partial(self.carry, tracked), self.network)
            film = film_of(drawing, self.frames, sequence.stamp_s[self.frames.start : self.frames.stop])
            if option == "--gif":
                maker.write_gif(path, film, done)
            else:
                maker.write_film(path, film, option, done)
        except OSError as error:
            raise ArgumentError(f"{option}: cannot write {path}: {error.strerror or error}") from None


def write_gif(film: Film, path: Path, done: Callable[[], None] = lambda: None) -> None:
    """Write an animated GIF that plays in real time.

    Raises:
        ArgumentError: The file cannot be written.
    """
    film.write(path, "--gif", done)


def write_video(film: Film, path: Path, done: Callable[[], None] = lambda: None) -> None:
    """Write an MP4 at the mean frame rate of the sequence.

    Raises:
        ArgumentError: There is no ffmpeg, or the file cannot be written.
    """
    film.write(path, "--video", done)
