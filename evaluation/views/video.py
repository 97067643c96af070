"""Films as MP4: pictures piped into ffmpeg."""

from __future__ import annotations

import contextlib
import itertools
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evaluation.errors import ArgumentError


def ffmpeg(option: str) -> str:
    """The ffmpeg to use: the one on the path, else that of the package imageio-ffmpeg.

    Args:
        option: the command line option that asks for a film, for the message.

    Raises:
        ArgumentError: there is none.
    """
    found = shutil.which("ffmpeg")
    if found:
        return found
    try:
        from imageio_ffmpeg import get_ffmpeg_exe  # type: ignore[import-not-found,import-untyped,unused-ignore]
    except ImportError:
        raise ArgumentError(
            f"{option}: no ffmpeg found; use --gif, or install it: "
            "apt install ffmpeg, pip install imageio-ffmpeg"
        ) from None
    return str(get_ffmpeg_exe())


def write_mp4(path: Path, pictures: Iterable[NDArray[np.uint8]], fps: float, option: str) -> None:
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
            pass  # it has given up; its last words say why
        said = process.stderr.read().decode(errors="replace").strip()
    try:
        if process.returncode:
            reason = (said.splitlines() or ["ffmpeg failed"])[-1]
            raise ArgumentError(f"{option}: cannot write {path}: {reason}")
        part.replace(path)
    except OSError as error:
        raise ArgumentError(f"{option}: cannot write {path}: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
