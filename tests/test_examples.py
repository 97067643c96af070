"""The scripts in `examples/` run as they are, in a folder of their own, and print what they are for."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
MOST_LINES = 60

PRINTED = {
    "locate_on_a_map": ("urban_intersection: 32 lanes", "roads ahead: "),
    "sweep_cpna": ("CPNA, preset paper", "picture: sweep_cpna.png"),
    "own_tracker": ("Run(CPNA, map, 50 km/h, real, dry: ", "tracker=object:Nearest"),
    "recorded_drive": ("Open loop", "path  rss"),
    "lidar_in_the_loop": ("ground truth: ", "LiDAR, clusters of points: "),
}


def test_every_example_is_here() -> None:
    # train_policy.py has a test of its own, in tests/evaluation/gym
    assert {path.stem for path in EXAMPLES.glob("*.py")} == {*PRINTED, "train_policy"}


@pytest.mark.parametrize("name", PRINTED)
def test_an_example_runs_and_is_short(name: str, tmp_path: Path) -> None:
    script = EXAMPLES / f"{name}.py"
    assert len(script.read_text(encoding="utf-8").splitlines()) < MOST_LINES
    words = [sys.executable, "-W", "error", str(script)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for text in PRINTED[name]:
        assert " ".join(text.split()) in " ".join(done.stdout.split()), done.stdout
    if name == "sweep_cpna":
        assert (tmp_path / "sweep_cpna.png").read_bytes().startswith(b"\x89PNG")


def test_the_page_about_python_runs_as_printed() -> None:
    page = Path(__file__).parents[1] / "docs/python.md"
    names: dict[str, object] = {}
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(blocks) == 2
    for block in blocks:
        exec(block, names)
    assert names["rows"]["v_test_kmh"].tolist() == [40, 50, 40, 50]  # type: ignore[index]
    assert len(names["log"]) > 1000  # type: ignore[arg-type]
