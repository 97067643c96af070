import functools
import gzip
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from opendrive import RoadNetwork, load_map

SHARED = Path(__file__).parents[2].parent / "shared" / "opendrive"


def _lane(lane_id: int, body: str, lane_type: str = "driving") -> str:
    return f'<lane id="{lane_id}" type="{lane_type}" level="false">{body}</lane>'


def _record(name: str, a: float, b: float = 0.0, c: float = 0.0, d: float = 0.0, s: float = 0.0) -> str:
    start = "sOffset" if name in ("width", "border") else "s"
    return f'<{name} {start}="{s!r}" a="{a!r}" b="{b!r}" c="{c!r}" d="{d!r}"/>'


def _section(s: float = 0.0, left: str = "", center: str = "", right: str = "") -> str:
    center = _lane(0, center, "none")
    lanes = f"<left>{left}</left><center>{center}</center><right>{right}</right>"
    return f'<laneSection s="{s!r}">{lanes}</laneSection>'


def _road(
    plan: str = '<geometry s="0" x="10" y="5" hdg="0.3" length="100"><line/></geometry>',
    sections: str | None = None,
    road_id: str = "r",
    length: float = 100.0,
    junction: str = "-1",
    attributes: str = "",
    link: str = "",
    offsets: str = "",
    extra: str = "",
) -> str:
    if sections is None:
        width = _record("width", 3.5)
        sections = _section(left=_lane(1, width), right=_lane(-1, width))
    return (
        f'<road name="" length="{length!r}" id="{road_id}" junction="{junction}" {attributes}>'
        f"<link>{link}</link><planView>{plan}</planView>{extra}<lanes>{offsets}{sections}</lanes></road>"
    )


def _document(*content: str) -> str:
    header = '<header revMajor="1" revMinor="8" name="made" version="1"/>'
    return f'<?xml version="1.0"?>\n<OpenDRIVE>{header}{"".join(content)}</OpenDRIVE>'


class MapText:
    """Pieces of OpenDRIVE text, for maps with a single feature."""

    lane = staticmethod(_lane)
    record = staticmethod(_record)
    section = staticmethod(_section)
    road = staticmethod(_road)
    document = staticmethod(_document)


@pytest.fixture(scope="session")
def text() -> type[MapText]:
    return MapText


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., RoadNetwork]:
    """Load a map from the text of its roads and junctions."""

    def load_text(*content: str, whole: bool = False) -> RoadNetwork:
        file = tmp_path / "map.xodr"
        file.write_text("".join(content) if whole else _document(*content), encoding="utf-8")
        return load_map(file)

    return load_text


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of the reference maps and values."""
    if not SHARED.is_dir():
        pytest.skip(f"reference maps are absent: {SHARED}")
    return SHARED


@functools.cache
def _network(path: Path) -> RoadNetwork:
    return load_map(path)


@pytest.fixture(scope="session")
def network_of(shared: Path) -> Callable[[str], RoadNetwork]:
    """Load a reference map by name, once per run."""
    return lambda name: _network(shared / "maps" / f"{name}.xodr")


@pytest.fixture(scope="session")
def field_map() -> Callable[..., RoadNetwork]:
    """Load a map of the field cases by name."""
    folder = Path(__file__).parents[1] / "data" / "field" / "opendrive"
    return lambda name, **options: load_map(folder / f"{name}.xodr", **options)


@pytest.fixture(scope="session")
def oracle(shared: Path) -> Callable[[str, str], dict[str, Any]]:
    """Read reference values of a map: oracle(name, kind)."""

    @functools.cache
    def read(name: str, kind: str) -> dict[str, Any]:
        file = shared / "oracle" / f"{name}.{kind}.json.gz"
        if not file.is_file():
            pytest.skip(f"no {kind} values for {name}: {file}")
        with gzip.open(file, "rt", encoding="utf-8") as stream:
            values: dict[str, Any] = json.load(stream)
        return values

    return read


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run tests that ask for `map_name` on every reference map, all of a map together: it is loaded once."""
    if "map_name" in metafunc.fixturenames:
        names = sorted(file.stem for file in (SHARED / "maps").glob("*.xodr"))
        metafunc.parametrize(
            "map_name",
            names or [pytest.param("", marks=pytest.mark.skip("no reference maps"))],
            scope="session",
        )
