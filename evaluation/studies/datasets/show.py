"""Frames of a data set as pictures from above, or as a page."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.results.files import write_bytes
from evaluation.runs.folder_lock import writable_folder
from evaluation.studies.datasets.reading import DatasetFrame, read_frames
from evaluation.views.cloud_page import ShownCloud, cloud_page
from evaluation.views.clouds import labelled_picture
from evaluation.views.pictures import save_picture

BEV, PAGE = "bev", "page"
MODES = (BEV, PAGE)

PAGE_HTML = "clouds.html"


def show_dataset(folder: Path, out: Path, mode: str, scene: str | None, most: int) -> list[Path]:
    """Write pictures or a page of a data set's first frames.

    Args:
        folder: of the data set.
        out: where to write.
        mode: one of `MODES`.
        scene: name of a scene, or its number; None: of all.
        most: frames at most.

    Raises:
        ArgumentError: there is no such scene, or no frame.
        DatasetError: the data set cannot be read.
    """
    frames = islice(_chosen(folder, scene), most)
    if mode == PAGE:
        page = cloud_page((_shown(frame) for frame in frames), f"{folder.name}: {scene or 'all scenes'}")
        write_bytes(out / PAGE_HTML, page.encode())
        return [out / PAGE_HTML]
    out = writable_folder(out)
    written = []
    for frame in frames:
        shown = _shown(frame)
        path = out / f"{frame.name}.png"
        figure = labelled_picture(shown.title, shown.cloud, shown.boxes, shown.category, shown.points)
        save_picture(figure, path, "--out")
        written.append(path)
    return written


def _shown(frame: DatasetFrame) -> ShownCloud:
    """A frame with its labels and their points."""
    title = ", ".join(part for part in (frame.name, frame.scene, frame.split) if part)
    return ShownCloud(title, frame.cloud, frame.boxes, frame.labels.category, frame.point_counts())


def _chosen(folder: Path, scene: str | None) -> Iterator[DatasetFrame]:
    """The frames of a scene."""
    count, scenes = 0, set()
    for frame in read_frames(folder):
        scenes.add(frame.scene)
        if scene is None or frame.scene == scene or _number(frame.scene) == _number(scene):
            count += 1
            yield frame
    if not count:
        names = sorted(scenes - {""})
        listed = ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
        raise ArgumentError(f"--scene: no {scene!r} in {folder}; there are: {listed or 'no scenes'}")


def _number(scene: str) -> int | None:
    """The number at the end of a scene's name."""
    digits = scene[len(scene.rstrip("0123456789")) :]
    return int(digits) if digits else None
