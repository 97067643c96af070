"""Frames drawn one after the other, as an animated GIF or, piped into ffmpeg, as MP4."""

from __future__ import annotations

import contextlib
import io
import itertools
import shutil
import subprocess
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import _smartmot
from evaluation.errors import ArgumentError
from evaluation.results.files import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from PIL import Image as Pillow

Image = NDArray[np.uint8]
"""(H, W, 3) colours of a picture."""


@dataclass(frozen=True, slots=True)
class Film:
    """What to show, in which order and for how long.

    Args:
        picture: draws a frame.
        reduce: a picture with the few colours of a GIF.
        frames: frame of each picture; one that stays is drawn once.
        durations_ms: how long each picture of a GIF stays.
        fps: pictures per second of an MP4.
        repeats: how often an MP4 shows the last picture besides.
    """

    picture: Callable[[int], Image]
    reduce: Callable[[Image], Pillow.Image]
    frames: Sequence[int]
    durations_ms: Sequence[int]
    fps: float
    repeats: int = 0

    def pictures(self, progress: Callable[[], None] = lambda: None) -> Iterator[Image]:
        """The pictures, each followed by a call of `progress`."""
        for frame, repeated in itertools.groupby(self.frames):
            image = self.picture(frame)
            for _ in repeated:
                progress()
                yield image


def pixels(figure: Figure) -> Image:
    """(H, W, 3) colours of what is drawn on a figure."""
    canvas: Any = figure.canvas
    # a copy: the canvas goes on to draw into its buffer
    return np.asarray(canvas.buffer_rgba(), dtype=np.uint8)[..., :3].copy()


def write(path: Path, film: Film, option: str, progress: Callable[[], None] = lambda: None) -> None:
    """Write a film as the command line option asks for it: `--gif` as a GIF, any other as MP4.

    Raises:
        OSError: the GIF cannot be written.
        ArgumentError: there is no ffmpeg, or the MP4 cannot be written.
    """
    if option == "--gif":
        write_gif(path, film, progress)
    else:
        write_film(path, film, option, progress)


def write_gif(path: Path, film: Film, progress: Callable[[], None] = lambda: None) -> None:
    """Write an animated GIF, as a whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    images = (film.reduce(image) for image in film.pictures(progress))
    content = io.BytesIO()
    next(images).save(
        content, format="GIF", save_all=True, append_images=images, duration=list(film.durations_ms), loop=0,
        optimize=False,
    )  # fmt: skip
    write_whole(path, content.getvalue())


def write_film(path: Path, film: Film, option: str, progress: Callable[[], None] = lambda: None) -> None:
    """Write an H.264 film with ffmpeg.

    Args:
        path: the file.
        film: what to show.
        option: the command line option that asks for it, for messages.
        progress: called after each picture.

    Raises:
        ArgumentError: there is no ffmpeg, or the file cannot be written.
    """
    write_mp4(path, _held(film.pictures(progress), film.repeats), film.fps, option)


def _held(images: Iterable[Image], repeats: int) -> Iterator[Image]:
    """Pictures, the last of them repeated."""
    image: Image | None = None
    for image in images:
        yield image
    if image is not None:
        yield from itertools.repeat(image, repeats)


def ffmpeg(option: str) -> str:
    """The ffmpeg to use: the one on the path, else that of the package imageio-ffmpeg.

    Args:
        option: the command line option that asks for a film, for the message.

    Raises:
        ArgumentError: there is none.
    """
    on_path = shutil.which("ffmpeg")
    if on_path:
        return on_path
    try:
        from imageio_ffmpeg import get_ffmpeg_exe  # type: ignore[import-not-found,import-untyped,unused-ignore]
    except ImportError:
        line = _smartmot.missing_extra("MP4 films", "film", "no ffmpeg")
        raise ArgumentError(f"{option}: {line}, or apt install ffmpeg, or use --gif") from None
    return str(get_ffmpeg_exe())


def write_mp4(path: Path, pictures: Iterable[Image], fps: float, option: str) -> None:
    """Write an H.264 film with ffmpeg, as a whole or not at all.

    Args:
        path: the file.
        pictures: (H, W, 3) colours of each picture, H and W even and the same for all.
        fps: pictures per second.
        option: the command line option that asks for a film, for messages.

    Raises:
        ArgumentError: there is no ffmpeg, or the file cannot be written.
    """
    program = ffmpeg(option)
    images = iter(pictures)
    first = next(images)
    height, width, _ = first.shape
    part = path.with_name(f".{path.name}.part")
    command = [
        program, "-y", "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}",
        "-r", f"{fps:g}", "-i", "-", "-an", "-c:v", "libx264", "-crf", "20", "-pix_fmt", "yuv420p",
        "-movflags", "+faststart", "-f", "mp4", str(part),
    ]  # fmt: skip
    with subprocess.Popen(command, stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        try:
            for image in itertools.chain((first,), images):
                process.stdin.write(image.tobytes())
            process.stdin.close()
        except BrokenPipeError:
            pass  # ffmpeg has given up; its last words say why
        last_words = process.stderr.read().decode(errors="replace").strip()
    try:
        if process.returncode:
            reason = (last_words.splitlines() or ["ffmpeg failed"])[-1]
            raise ArgumentError(f"{option}: cannot write {path}: {reason}")
        part.replace(path)
    except OSError as error:
        raise ArgumentError(f"{option}: cannot write {path}: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
