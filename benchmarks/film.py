"""Time of the pictures of a film over that of whole pictures, in turns in the same process.

    python -m benchmarks.film RESULTS/NAME

Of every fourth frame of a run the picture as `smartmot-eval replay` draws it, and then the same with all
artists drawn anew where they stand. They have to be equal in every pixel. Printed: processor times, their
ratio, and the time of the whole GIF.
"""

import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.views.film.maker import Image, pixels
from evaluation.views.film.replay import drawing_of, replay
from evaluation.views.film.run import RunDrawing

EACH = 4


def whole_picture(drawing: RunDrawing) -> Image:
    """The last picture again, with all that is on the figure drawn anew."""
    figure = drawing.figure
    moving: list[Any] = [artist for artist in figure.findobj() if artist.get_animated()]
    for artist in moving:
        artist.set_animated(False)
    figure.canvas.draw()
    image = pixels(figure)
    for artist in moving:
        artist.set_animated(True)
    return image


def main() -> None:
    """Print the times."""
    run = Path(sys.argv[1])
    drawing, _ = drawing_of(run)
    drawing.picture(0)
    spent = {"moving": 0.0, "whole": 0.0}
    for frame in range(0, len(drawing.frames), EACH):
        start = time.process_time()
        image = drawing.picture(frame)
        middle = time.process_time()
        equal = whole_picture(drawing)
        spent["moving"] += middle - start
        spent["whole"] += time.process_time() - middle
        assert np.array_equal(image, equal), frame
    count = len(range(0, len(drawing.frames), EACH))
    for name, total in spent.items():
        print(f"{name}: {1000 * total / count:.1f} ms a picture")
    print(f"ratio: {spent['whole'] / spent['moving']:.1f}")
    with tempfile.TemporaryDirectory() as folder:
        start, began = time.process_time(), time.perf_counter()
        replay(run, Path(folder) / "film.gif", None)
        took = time.perf_counter() - began
        spent_s = time.process_time() - start
        print(f"GIF of {len(drawing.frames)} frames: {spent_s:.1f} s, {took:.1f} s by the clock")


if __name__ == "__main__":
    main()
