"""What holds for the project as a whole: who imports whom, what is installed, what start-up may load."""

import ast
import importlib
import re
import subprocess
import sys
import tomllib
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import _smartmot
import smartmot

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("opendrive", "smartmot", "scenarios", "evaluation")
HEAVY = ("highway_env", "gymnasium", "pygame", "pandas", "pyarrow", "matplotlib", "scipy", "plotly", "jinja2")


def python(code: str) -> str:
    """Run code in a fresh interpreter and return what it printed."""
    run = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout


@pytest.fixture(scope="module")
def project() -> dict[str, Any]:
    table: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    return table


def pins(name: str) -> dict[str, str]:
    lines = (ROOT / "requirements" / name).read_text().splitlines()
    pinned = [line.split("==") for line in lines if line and not line.startswith(("#", "-r "))]
    return {canonicalize_name(package): number for package, number in pinned}


def test_import_contract_holds() -> None:
    code = "import sys; from importlinter.cli import lint_imports; sys.exit(lint_imports(no_cache=True))"
    kept = re.search(r"\b(\d+) kept, 0 broken", python(code))
    assert kept is not None
    assert int(kept[1]) >= 7


def test_import_of_the_command_line_is_light() -> None:
    loaded = python(f"import sys, evaluation.cli; print([m for m in {HEAVY} if m in sys.modules])")
    assert loaded.strip() == "[]"


def test_import_of_the_tracker_is_light() -> None:
    code = "import sys, smartmot; smartmot.Tracker; smartmot.Pipeline; smartmot.route_ahead; "
    loaded = python(f"{code} print([m for m in {HEAVY} if m in sys.modules])")
    assert loaded.strip() == "[]"


def test_import_of_the_front_door_loads_nothing_yet() -> None:
    code = """
import time
start_s = time.process_time()
import smartmot
spent_s = time.process_time() - start_s
import sys
loaded = [name for name in sys.modules if name.partition(".")[0] in ("numpy", "evaluation", "scenarios")]
print(loaded, spent_s < 0.3)
"""
    assert python(code).strip() == "[] True"


def test_the_front_door_gives_type_checkers_what_it_loads() -> None:
    """The names that are exported, loaded at first use, and imported for type checkers are the same."""
    tree = ast.parse((ROOT / "smartmot/__init__.py").read_text(encoding="utf-8"))
    block = next(node for node in tree.body if isinstance(node, ast.If))
    typed = {
        (node.module, alias.name)
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    homes: dict[str, str] = vars(smartmot)["_HOMES"]
    assert typed == {(module, name) for module, names in homes.items() for name in names.split()}
    assert sorted(name for _, name in typed) == sorted(smartmot.__all__)
    assert set(smartmot.__all__) <= set(dir(smartmot))
    for module, name in typed:
        assert getattr(smartmot, name) is getattr(importlib.import_module(str(module)), name)


def test_unknown_names_of_the_front_door_are_errors_with_a_suggestion() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'swep'") as caught:
        _ = smartmot.swep  # type: ignore[attr-defined]
    assert (caught.value.name, caught.value.obj) == ("swep", smartmot)  # from which Python suggests sweep
    assert not hasattr(smartmot, "_hidden")
    assert smartmot.types.CATEGORIES  # modules are loaded as well


def test_opendrive_alone_needs_four_libraries() -> None:
    """Numpy, scipy, shapely and lxml: a map is loaded and asked with everything else out of reach."""
    street = ROOT / "scenarios/maps/urban_street.xodr"
    code = f"""
import sys
allowed = {{"numpy", "scipy", "shapely", "lxml", "opendrive", "_smartmot"}}
class Nothing:
    def find_spec(self, name, path=None, target=None):
        top = name.partition(".")[0]
        if top not in allowed and top not in sys.stdlib_module_names and not top.startswith("_"):
            raise ImportError(f"{{name}} is out of reach", name=name)
sys.meta_path.insert(0, Nothing())
import opendrive
network = opendrive.load_map({str(street)!r})
hits = network.locate([[100.0, -1.75]])
print(len(network.lanes) > 0, len(hits.lane) > 0, len(network.findings) >= 0)
"""
    assert python(code).split() == ["True", "True", "True"]


def test_help_is_light() -> None:
    code = f"""
import sys
from evaluation.cli import main
sys.argv = ["smartmot-eval", "--help"]
try:
    main()
except SystemExit as stop:
    assert not stop.code, stop.code
print([m for m in {HEAVY} if m in sys.modules])
"""
    lines = python(code).splitlines()
    assert any("Usage" in line for line in lines)
    assert lines[-1] == "[]"


def test_installed_version_is_the_one_of_the_source(project: dict[str, Any]) -> None:
    assert version("smartmot") == project["version"]


@pytest.mark.parametrize("package", PACKAGES)
def test_package_declares_its_types(package: str) -> None:
    assert (files(package) / "py.typed").is_file()


@pytest.mark.parametrize("name", ["run.txt", "dev.txt", "train.txt", "docs.txt"])
def test_requirements_are_exact_pins_and_nothing_else(name: str) -> None:
    for line in (ROOT / "requirements" / name).read_text().splitlines():
        assert re.fullmatch(r"#.*|-r (run|dev)\.txt|[A-Za-z0-9_.-]+==[0-9][0-9A-Za-z.]*", line), line


def test_pins_satisfy_the_declared_dependencies(project: dict[str, Any]) -> None:
    run, extras = pins("run.txt"), project["optional-dependencies"]
    # netconvert has 530 MB: only .ci/exports installs it.
    optional = [requirement for name, extra in extras.items() if name != "sumo" for requirement in extra]
    others = run | pins("dev.txt") | pins("train.txt") | pins("docs.txt")
    for declared, pinned in ((project["dependencies"], run), (optional, others)):
        for requirement in (r for r in map(Requirement, declared) if r.name != project["name"]):
            assert pinned[canonicalize_name(requirement.name)] in requirement.specifier, requirement


def test_each_missing_extra_is_one_that_there_is(project: dict[str, Any]) -> None:
    """What says that an extra is missing names one of the project's, in the words of one function."""
    extras = set(project["optional-dependencies"])
    sources = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    named: set[str] = set()
    for path in sources:
        text = path.read_text(encoding="utf-8")
        for call in re.findall(r"missing_extra\(([^)]*)", text):
            named |= set(re.findall(r'"([a-z]+)"', call)) & extras
        assert "pip install 'smartmot" not in text or path.parts[-2:] == ("cli", "mot.py"), path
    assert named >= {"ros", "osi", "foxglove", "metrics", "maps", "sumo", "lidar", "training", "film"}
    line = _smartmot.missing_extra("ROS bags", "ros", ImportError("no rosbags"))
    assert line == "ROS bags need the extra ros (no rosbags); install it with: pip install 'smartmot[ros]'"


def test_nothing_lies_beside_the_checkout() -> None:
    """A user has no folder next to the project: the package and its pages name none."""
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    sources = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    outside = re.compile(r"\.\./shared|/ ['\"]shared['\"]")
    assert len(sources) > 200
    assert [path for path in (*pages, *sources) if outside.search(path.read_text(encoding="utf-8"))] == []


def test_tests_named_in_scripts_exist() -> None:
    paths = re.findall(r"tests/[\w/.]+", (ROOT / ".ci" / "versions").read_text())
    assert len(paths) >= 3
    assert [path for path in paths if not (ROOT / path).exists()] == []


LONGEST = 500
"""Lines of a module; a longer one gives its reason."""
MOST_MODULES = 14
"""Modules of a room, without `__init__.py`."""


def test_modules_are_short_or_say_why() -> None:
    files = [path for package in PACKAGES for path in (ROOT / package).rglob("*.py")]
    long = [path for path in files if len(path.read_text().splitlines()) > LONGEST]
    unexplained = [
        str(path.relative_to(ROOT)) for path in long if "Long because" not in path.read_text()[:3000]
    ]
    assert unexplained == []


def test_rooms_are_small() -> None:
    folders = [path for package in PACKAGES for path in (ROOT / package).rglob("*") if path.is_dir()]
    crowded = {
        str(folder.relative_to(ROOT)): len(modules)
        for folder in [*folders, *(ROOT / package for package in PACKAGES)]
        if len(modules := [p for p in folder.glob("*.py") if p.stem != "__init__"]) > MOST_MODULES
    }
    assert crowded == {}
