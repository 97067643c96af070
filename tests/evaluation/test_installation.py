"""The command as people install it, in folders with names of ours, of Python and of libraries."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CASES = ROOT / "tests" / "data" / "field" / "first_hour"
PACKAGES = ("opendrive", "smartmot", "scenarios", "evaluation")
TAKEN = [
    *("random", "json", "logging", "signal", "threading", "socket", "selectors", "struct"),
    *("numpy", "pandas", "typer"),
]
"""Names of modules that the command, its processes or their libraries import."""


@dataclass(frozen=True)
class Installed:
    """An environment with the distribution in it, not editable."""

    python: Path
    site: Path

    def run(self, folder: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
        inherited = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
        return subprocess.run(
            [self.python, *words],
            cwd=folder,
            env={**inherited, "PYTHONDONTWRITEBYTECODE": "1", **environment},
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )

    def command(self, folder: Path, *words: str, **environment: str) -> subprocess.CompletedProcess[str]:
        return self.run(folder, str(self.site / "bin" / "smartmot-eval"), *words, **environment)


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    """Its libraries are those of the environment that runs the tests."""
    folder = tmp_path_factory.mktemp("installed")
    source = folder / "source"
    source.mkdir()
    for name in PACKAGES:
        shutil.copytree(ROOT / name, source / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("_smartmot.py", "pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "venv"], check=True)
    [site] = (folder / "venv").glob("lib/python*/site-packages")
    subprocess.run(
        f"{sys.executable} -m pip install -q --no-deps --no-build-isolation --target {site} {source}".split(),
        check=True,
        capture_output=True,
    )
    libraries = [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]
    (site / "libraries.pth").write_text("\n".join(libraries))
    return Installed(folder / "venv" / "bin" / "python", site)


@pytest.fixture
def shadowing(tmp_path: Path) -> Path:
    """A folder in which nothing of the user's may be executed but the tracker that is named."""
    folder = tmp_path / "shadowing"
    shutil.copytree(CASES / "shadowing", folder)
    executed = "raise SystemExit(f'{__file__} of the user was executed')\n"
    for name in TAKEN:
        (folder / f"{name}.py").write_text(executed)
    for name in PACKAGES:
        (folder / name).mkdir(exist_ok=True)
        (folder / name / "__init__.py").write_text(executed)
    # the plug-in imports a sibling
    (folder / "my_settings.py").write_text('NAME = "default"\n')
    text = (folder / "my_tracker.py").read_text()
    (folder / "my_tracker.py").write_text(
        text.replace("import smartmot", "import smartmot\nfrom my_settings import NAME").replace(
            '"default"', "NAME"
        )
    )
    return folder


COMMANDS = {
    "cpna": "cpna --speeds 30,40 --strategy map --tracker my_tracker:make --no-pictures",
    "run": "run cpna_paper --strategy map,all --tracker my_tracker:make --no-pictures",
    "ncap": "ncap --protocol paper --strategy map --tracker my_tracker:make",
    "compare": "compare --strategies map --vary tracker=my_tracker:make --scenes walking_along --seeds 1",
}


@pytest.mark.parametrize(
    ("name", "workers"),
    [("cpna", "1"), ("cpna", "2"), ("run", "2"), ("ncap", "1"), ("compare", "1"), ("compare", "2")],
)
def test_files_of_the_user_neither_break_nor_enter_a_command(
    installed: Installed, shadowing: Path, name: str, workers: str
) -> None:
    words = [word.replace("_along", " along") for word in COMMANDS[name].split()]
    run = installed.command(shadowing, *words, "--workers", workers, "--out", "out", "-q")
    assert (run.returncode, run.stderr) == (0, "")
    assert list((shadowing / "out").rglob("*.csv"))


def test_files_that_are_no_code_are_installed(installed: Installed) -> None:
    """Maps, scenarios, the scenes' table, templates."""
    data = [
        path.relative_to(ROOT)
        for name in PACKAGES
        for path in (ROOT / name).rglob("*")
        if path.is_file() and path.suffix != ".py" and "__pycache__" not in path.parts
    ]
    assert {path.suffix for path in data} >= {".xodr", ".xosc", ".toml", ".j2", ".typed"}
    assert [path for path in data if not (installed.site / path).is_file()] == []


def test_files_of_the_user_do_not_enter_mot(installed: Installed, shadowing: Path) -> None:
    rows = "".join(f"a,{0.1 * k},{0.5 * k},0,4.5,1.8,0,0.9,car\n" for k in range(8))
    (shadowing / "data").mkdir()
    (shadowing / "data" / "detections.csv").write_text(
        "sequence,stamp_s,x_m,y_m,length_m,width_m,yaw_rad,score,category\n" + rows
    )
    run = installed.command(shadowing, "mot", "data", "--config", "my_tracker:make", "--out", "out", "-q")
    assert (run.returncode, run.stderr) == (0, "")
    assert list((shadowing / "out").rglob("*.csv"))


@pytest.mark.parametrize("name", PACKAGES)
def test_a_package_that_comes_first_by_pythonpath_is_named(
    installed: Installed, tmp_path: Path, name: str
) -> None:
    """As a file, and as a folder; neither is executed."""
    theirs = [tmp_path / "a" / f"{name}.py", tmp_path / "b" / name / "__init__.py"]
    for file in theirs:
        file.parent.mkdir(parents=True)
        file.write_text("raise SystemExit('executed')\n")
        folder = tmp_path / file.relative_to(tmp_path).parts[0]
        run = installed.command(folder, "cpna", "--out", "out", PYTHONPATH=".")
        assert run.returncode == 2
        assert run.stdout == ""
        ours = installed.site / name / "__init__.py"
        assert run.stderr.startswith(
            f"smartmot-eval: {file} has the name of smartmot's own package {name} ({ours}) and comes first"
        )
        assert run.stderr.count("\n") == 1
        assert not (folder / "out").exists()


def test_other_files_in_pythonpath_are_nobodys_business(installed: Installed, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("")
    (tmp_path / "scenarios").mkdir()  # no package: Python goes on looking
    run = installed.command(tmp_path, "list", PYTHONPATH=".")
    assert (run.returncode, run.stderr) == (0, "")
    assert "cpna" in run.stdout


def test_the_package_as_command(installed: Installed, shadowing: Path, tmp_path: Path) -> None:
    """`-m` puts the current folder first. A folder named like the package itself is beyond any package."""
    for name in ("evaluation", "scenarios", "smartmot", "opendrive"):
        shutil.rmtree(shadowing / name)
    (shadowing / "evaluation.py").unlink()
    for file in shadowing.glob("*.py"):
        if file.stem in ("struct", "signal", "threading"):  # Python itself needs them for -m
            file.unlink()
    run = installed.run(shadowing, "-m", "evaluation", "list")
    assert (run.returncode, run.stderr) == (0, "")
    (shadowing / "scenarios").mkdir()
    (shadowing / "scenarios" / "__init__.py").write_text("raise SystemExit('executed')\n")
    run = installed.run(shadowing, "-m", "evaluation", "list")
    assert run.returncode != 0
    assert f"{shadowing / 'scenarios' / '__init__.py'} has the name of smartmot's own package" in run.stderr


def test_a_script_beside_a_package_of_ours_name_is_told(installed: Installed, tmp_path: Path) -> None:
    """It gets the user's; the first import that needs ours says so, and names both."""
    shutil.copytree(CASES / "user_project", tmp_path, dirs_exist_ok=True)
    theirs = tmp_path / "scenarios" / "__init__.py"
    for first in ("import smartmot", "import opendrive", "from opendrive import load_map"):
        (tmp_path / "script.py").write_text(f"{first}\n{(tmp_path / 'example.py').read_text()}")
        run = installed.run(tmp_path, "script.py")
        assert run.returncode == 1
        last = run.stderr.splitlines()[-1]
        assert last.startswith(f"ImportError: scenarios.presets cannot be imported: {theirs} has the name of")
        assert str(installed.site / "scenarios" / "__init__.py") in last
    (tmp_path / "script.py").write_text("import evaluation.results.rows\n")
    run = installed.run(tmp_path, "script.py")
    assert f"ImportError: evaluation cannot be imported: {theirs} has the name of" in run.stderr
    # what does not need it works: the user's own package is nobody's business
    (tmp_path / "script.py").write_text("import smartmot, scenarios\nprint(scenarios.__file__)\n")
    assert installed.run(tmp_path, "script.py").stdout.strip() == str(theirs)


@pytest.mark.parametrize(
    ("module", "told"),
    [
        ("random", "has the name of a module of Python; rename it"),
        ("numpy", "have the same name; rename the first"),
        ("pandas", "have the same name; rename the first"),
        ("scenarios", "have the same name; rename the first"),
        ("evaluation", "have the same name; rename the first"),
    ],
)
def test_a_plugin_with_a_taken_name_is_refused(
    installed: Installed, shadowing: Path, module: str, told: str
) -> None:
    run = installed.command(shadowing, "cpna", "--tracker", f"{module}:make", "--out", "out")
    assert run.returncode == 2
    assert run.stderr.startswith(f"smartmot-eval: {module}:make: {shadowing}")
    assert told in run.stderr
    assert run.stderr.count("\n") == 1
