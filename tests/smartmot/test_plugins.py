import sys
from pathlib import Path

import pytest

from smartmot.errors import PluginError
from smartmot.plugins import is_plugin, plugin, require

SOURCE = """
class Thing:
    def __init__(self, value=1):
        self.value = 1 / value
    class Inner:
        pass

number = 5

def inverse():
    import numpy as np
    return np.linalg.inv(np.zeros((2, 2)))

def refuses():
    from smartmot.errors import ConfigError
    raise ConfigError("no")
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder, whose modules are forgotten afterwards."""
    before = set(sys.modules)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    yield tmp_path
    for name in set(sys.modules) - before:
        del sys.modules[name]


def test_a_class_of_the_current_folder_is_made_with_what_it_is_given(folder: Path) -> None:
    (folder / "thing_a.py").write_text(SOURCE)
    made = plugin("thing_a:Thing")
    assert made(4).value == 0.25
    assert type(plugin("thing_a:Thing.Inner")()).__qualname__ == "Thing.Inner"
    assert is_plugin(made.name)
    assert not is_plugin("rectangular")
    assert not is_plugin("C:\\detectors\\profile.json")


def test_the_digest_is_that_of_the_source(folder: Path) -> None:
    """Another text, another digest; a package is digested as a whole."""
    for name, text in (("one_b", SOURCE), ("two_b", SOURCE + "# changed\n")):
        (folder / name).mkdir()
        (folder / name / "__init__.py").write_text("")
        (folder / name / "things.py").write_text(SOURCE)
        (folder / name / "helper.py").write_text(text)
    (folder / "same_b").mkdir()
    for path in (folder / "one_b").iterdir():
        (folder / "same_b" / path.name).write_bytes(path.read_bytes())
    one, two, same = (plugin(f"{name}_b.things:Thing").digest for name in ("one", "two", "same"))
    assert one == same != two


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("thing_c", "expected package.module:name"),
        ("thing_c:", "expected package.module:name"),
        (":Thing", "expected package.module:name"),
        ("thing c:Thing", "expected package.module:name"),
        ("../thing_c:Thing", "expected package.module:name"),
        ("missing_c:Thing", "no module 'missing_c'; it must be installed or lie in the current folder"),
        ("thing_c.missing:Thing", "no module 'thing_c.missing'"),
        ("thing_c:Nothing", "thing_c has no 'Nothing'"),
        ("thing_c:Thing.nothing", "Thing has no 'nothing'"),
        ("thing_c:number", "is no class or function"),
        ("needs_c:Thing", "No module named 'not_installed_c'"),
        ("wrong_c:Thing", "SyntaxError"),
        ("fails_c:Thing", "ZeroDivisionError: division by zero"),
        ("leaves_c:Thing", "SystemExit: 3"),
    ],
)
def test_what_cannot_be_loaded_is_named_in_one_line(folder: Path, name: str, told: str) -> None:
    (folder / "thing_c.py").write_text(SOURCE)
    (folder / "needs_c.py").write_text("import not_installed_c\n")
    (folder / "wrong_c.py").write_text("\nclass Thing\n")
    (folder / "leaves_c.py").write_text("\nraise SystemExit(3)\n")
    (folder / "fails_c.py").write_text("\n1 / 0\n")
    with pytest.raises(PluginError) as caught:
        plugin(name)
    message = str(caught.value)
    assert told in message
    assert name in message
    assert "\n" not in message
    module = name.partition(":")[0]
    if module in ("fails_c", "wrong_c", "leaves_c"):
        assert message.endswith(f"({folder / module}.py, line 2)")


@pytest.mark.parametrize("module", ["random", "json", "numpy", "filterpy", "smartmot", "scenarios"])
def test_a_module_whose_name_is_taken_is_refused_unread(folder: Path, module: str) -> None:
    file = folder / f"{module}.py"
    file.write_text("raise SystemExit('executed')\n")
    with pytest.raises(PluginError, match="rename") as caught:
        plugin(f"{module}:Thing")
    assert str(caught.value).startswith(f"{module}:Thing: {file} ")


def test_without_a_current_folder_what_is_installed_is_loaded(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def gone() -> Path:
        raise FileNotFoundError(2, "No such file or directory")

    monkeypatch.setattr(Path, "cwd", gone)
    assert plugin("fractions:Fraction")(1, 2) == 0.5
    with pytest.raises(PluginError, match="no module 'thing_g'"):
        plugin("thing_g:Thing")


def test_other_modules_of_the_folder_take_the_place_of_none(folder: Path) -> None:
    """A plug-in imports its siblings, and Python's modules although the folder has files of their names."""
    (folder / "colorsys.py").write_text("raise SystemExit('executed')\n")
    (folder / "helper_e.py").write_text("ANSWER = 42\n")
    (folder / "thing_e.py").write_text(
        "import colorsys\nfrom helper_e import ANSWER\ndef make():\n"
        "    return ANSWER, colorsys.rgb_to_hsv(1, 1, 1)\n"
    )
    sys.modules.pop("colorsys", None)
    assert plugin("thing_e:make")() == (42, (0.0, 0.0, 1))


def test_what_fails_when_it_is_made_says_where(folder: Path) -> None:
    (folder / "thing_d.py").write_text(SOURCE)
    with pytest.raises(PluginError, match=r"thing_d:Thing: ZeroDivisionError: .*thing_d\.py, line 4\)$"):
        plugin("thing_d:Thing")(0)
    with pytest.raises(PluginError, match=r"thing_d:inverse: LinAlgError: .*\(.*thing_d\.py, line 12\)$"):
        plugin("thing_d:inverse")()  # not the line of the library that it calls
    with pytest.raises(PluginError, match=r"is called with \(int, str\), but: too many .*docs/plugins\.md$"):
        plugin("thing_d:Thing")(1, "x")
    with pytest.raises(PluginError, match=r"thing_d:Thing: made Thing, which has no run\(\)"):
        require(plugin("thing_d:Thing")(4), "run", "thing_d:Thing")
    with pytest.raises(ValueError, match=r"^no$"):  # one of our own errors says enough
        plugin("thing_d:refuses")()
