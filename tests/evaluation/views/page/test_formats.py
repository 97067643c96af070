"""Vector pictures on request."""

from collections.abc import Callable
from pathlib import Path

import pytest

BEGINNINGS = {"svg": b"<?xml", "pdf": b"%PDF-", "png": b"\x89PNG"}


@pytest.mark.parametrize("form", list(BEGINNINGS))
def test_pictures_of_a_test_in_the_format_asked_for(
    tmp_path: Path, command: Callable[..., int], form: str
) -> None:
    arguments = ("--speeds", "50", "--strategy", "map", "--quiet", "--out", tmp_path)
    assert command("cpna", *arguments, "--format", form) == 0
    pictures = sorted(path for path in tmp_path.iterdir() if path.suffix[1:] in BEGINNINGS)
    assert [p.name for p in pictures] == [
        f"{n}.{form}" for n in ("birdseye", "speed_curves", "temporal_diagram")
    ]
    assert all(path.read_bytes().startswith(BEGINNINGS[form]) for path in pictures)


def test_an_unknown_format_is_refused_before_anything_runs(
    tmp_path: Path, command: Callable[..., int], capfd: pytest.CaptureFixture[str]
) -> None:
    assert command("cpna", "--speeds", "50", "--format", "bmp", "--out", tmp_path / "out") == 2
    assert capfd.readouterr().err == "smartmot-eval: --format: unknown 'bmp'; use one of: png, svg, pdf\n"
    assert not (tmp_path / "out").exists()
