"""The page of a folder of runs, made once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def report(folder: Path, tmp_path_factory: pytest.TempPathFactory, command: Callable[..., int]) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    assert command("report", folder, "--out", path, "--quiet") == 0
    return path
