"""The container: what its description promises; built and run by `.ci/container`, where that is asked for."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LINES = [
    line.strip()
    for line in (ROOT / "Containerfile").read_text(encoding="utf-8").replace("\\\n", " ").splitlines()
    if line.strip() and not line.startswith("#")
]


def instructions(name: str) -> list[str]:
    return [line.partition(" ")[2] for line in LINES if line.startswith(f"{name} ")]


def test_every_stage_stands_on_the_base_of_the_argument() -> None:
    assert LINES[0].startswith("ARG BASE=")
    stages = instructions("FROM")
    assert len(stages) == 2
    assert all(stage.split()[0] == "${BASE}" for stage in stages)


def test_the_last_stage_has_the_environment_alone_and_no_root() -> None:
    last = LINES[max(k for k, line in enumerate(LINES) if line.startswith("FROM ")) :]
    copied = [line for line in last if line.startswith(("COPY", "ADD"))]
    assert copied == ["COPY --from=build /opt/smartmot /opt/smartmot"]
    [user] = [line.split()[1] for line in last if line.startswith("USER ")]
    assert re.fullmatch(r"[1-9]\d*:[1-9]\d*", user)
    assert last.index(f"USER {user}") < next(
        k for k, line in enumerate(last) if line.startswith("ENTRYPOINT")
    )


def test_what_is_copied_is_there_and_not_ignored() -> None:
    kept = [line[1:] for line in (ROOT / ".containerignore").read_text().splitlines() if line.startswith("!")]
    for line in instructions("COPY"):
        if line.startswith("--from"):
            continue
        *sources, _ = line.split()
        for source in sources:
            assert (ROOT / source).exists(), source
            assert any(Path(source).match(pattern) for pattern in kept), source


def test_built_and_run() -> None:
    """5 minutes, and rights to mount: `SMARTMOT_CONTAINER=required` asks for it."""
    if os.environ.get("SMARTMOT_CONTAINER") != "required":
        there = "is" if shutil.which("buildah") else "is not"
        pytest.skip(f"SMARTMOT_CONTAINER=required builds and runs the container; buildah {there} here")
    done = subprocess.run([ROOT / ".ci" / "container"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    size = re.search(r"^container: (\d+) MB", done.stdout, re.M)
    assert size is not None
    assert int(size[1]) < 1000
