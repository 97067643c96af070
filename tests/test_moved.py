"""Old names of modules: they give the new ones, with a warning; nothing of ours uses them."""

import ast
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import _smartmot

ROOT = Path(__file__).resolve().parents[1]
FIELD = ROOT / "tests" / "data" / "field"
PACKAGES = ("opendrive", "smartmot", "scenarios", "evaluation")


def run(code: str) -> str:
    """What a fresh interpreter prints."""
    result = subprocess.run(
        [sys.executable, "-W", "default", "-c", code], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


def test_every_old_name_gives_the_new_module_and_a_warning() -> None:
    out = run(
        """
import importlib, warnings
import _smartmot
for old, new in _smartmot.MOVED.items():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        module = importlib.import_module(old)
    assert any(f"{old} has moved to" in str(w.message) for w in caught), old
    first, *more = new.split()
    if more:
        for part in new.split():
            importlib.import_module(part)
    else:
        assert module is importlib.import_module(first), old
        assert module.__spec__.name == first, (old, module.__spec__.name)
print(len(_smartmot.MOVED))
"""
    )
    assert int(out) > 100


def imported(file: Path) -> list[tuple[str, str]]:
    """Modules of ours and the names that a file takes from them."""
    return [
        (node.module, alias.name)
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in PACKAGES
        for alias in node.names
    ]


def test_files_of_users_find_what_they_import() -> None:
    names = sorted({pair for file in FIELD.rglob("*.py") for pair in imported(file)})
    assert len(names) > 25
    checks = "".join(f"from {module} import {name}\n" for module, name in names)
    run(checks)


def test_tests_of_users_pass(tmp_path: Path) -> None:
    folder = tmp_path / "code"
    shutil.copytree(FIELD / "code", folder)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", os.devnull]
    result = subprocess.run(
        [*command, "--rootdir", folder, folder], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert result.returncode == 0, result.stdout
    assert "16 passed" in result.stdout


def test_the_study_of_a_user_runs() -> None:
    """Strategies and sensors of plug-ins written for 0.1.0, with a loop of the user's own."""
    labels = ["map+route", "all+route", "rect_fair", "map+route | loc +1.0 m across"]
    code = f"""
import sys
sys.path.insert(0, {str(FIELD / "runs" / "study")!r})
import drive
for label in {labels!r}:
    row = drive.one((label, 30, 0))
    assert "err" not in row, row
    print(row["flag"])
"""
    flags = [float(line) for line in run(code).split()]
    assert len(flags) == len(labels)
    assert min(flags) > 2.0


def test_nothing_of_ours_uses_an_old_name() -> None:
    old = {name for name in _smartmot.MOVED if name not in ("evaluation.mot",)}
    files = [
        file
        for folder in (*PACKAGES, "benchmarks", "tests")
        for file in (ROOT / folder).rglob("*.py")
        if FIELD not in file.parents
    ]
    wrong = [
        f"{file.relative_to(ROOT)}: {module}"
        for file in files
        for module, name in imported(file)
        if module in old or f"{module}.{name}" in old
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "page", ["README.md", *(str(file.relative_to(ROOT)) for file in (ROOT / "docs").rglob("*.md"))]
)
def test_pages_use_no_old_name(page: str) -> None:
    if page == "docs/moved.md":
        return
    text = (ROOT / page).read_text(encoding="utf-8")
    dotted = set(re.findall(r"(?<![\w./])(?:opendrive|smartmot|scenarios|evaluation)(?:\.\w+)+", text))
    assert sorted(dotted & _smartmot.MOVED.keys()) == []


def test_the_page_for_users_of_internals_has_every_old_name() -> None:
    text = (ROOT / "docs" / "moved.md").read_text(encoding="utf-8")
    missing = [old for old in _smartmot.MOVED if f"`{old}`" not in text]
    assert missing == []
