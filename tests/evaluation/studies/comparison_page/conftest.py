"""A comparison with logs."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from evaluation.cli import main


@pytest.fixture(scope="session")
def logged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two widths of the rectangle over two scenes."""
    out = tmp_path_factory.mktemp("compare") / "results"
    arguments = ["--scenes", "people at the kerb,crosses in a bend", "--strategies", "rectangular"]
    arguments += [
        "--vary",
        "half_width_m=0.9,4",
        "--seeds",
        "1",
        "--logs",
        "--quiet",
        "--workers",
        "1",
        "--out",
        str(out),
    ]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", "compare", *arguments])
        with pytest.raises(SystemExit) as stop:
            main()
    assert not stop.value.code
    return out
