"""The grids against Vector's OpenSCENARIO files of the protocols."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from pathlib import Path

import pytest
from lxml import etree

from evaluation.protocols.euroncap_2023 import EuroNcap2023
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026
from evaluation.protocols.grid import Cell, Function, Layer, Lighting

FILES = Path(__file__).resolve().parents[4] / "shared" / "ncap" / "scenarios" / "OpenSCENARIO" / "NCAP"

pytestmark = pytest.mark.skipif(not FILES.is_dir(), reason=f"no scenario files in {FILES}")

Parameters = dict[str, str]


def variations(path: Path) -> list[Parameters]:
    """Every combination of a file's deterministic distributions."""
    axes: list[list[Parameters]] = []
    root = etree.parse(path).getroot()
    for single in root.iter("DeterministicSingleParameterDistribution"):
        name = single.get("parameterName")
        values = [element.get("value") for element in single.iter("Element")]
        for distribution in single.iter("DistributionRange"):
            limits = distribution.find("Range")
            low, high = float(limits.get("lowerLimit")), float(limits.get("upperLimit"))
            step = float(distribution.get("stepWidth"))
            values += [f"{low + i * step:g}" for i in range(round((high - low) / step) + 1)]
        axes.append([{name: value} for value in values])
    axes.extend(
        [
            {a.get("parameterRef"): a.get("value") for a in one.iter("ParameterAssignment")}
            for one in multi.iter("ParameterValueSet")
        ]
        for multi in root.iter("ValueSetDistribution")
    )
    return [dict(itertools.chain(*(axis.items() for axis in combo))) for combo in itertools.product(*axes)]


def number(parameters: Parameters, *names: str) -> float | None:
    found = [float(parameters[name]) for name in names if name in parameters]
    return found[0] if found else None


def target_kmh(cell: Cell, parameters: Parameters) -> float | None:
    """The target's speed where the file says it; a braking target is known by its first speed."""
    names = ("Target_init_speed_kph", "Target_final_speed_kph", "VRU_finalSpeed_kph")
    given = number(parameters, *(names if cell.scenario[2:] != "Rb" else names[:1]))
    return cell.target_speed_kmh if given is None else given


NAMES_2026 = sorted(p.stem for p in (FILES / "CA-FC_2026/Variations/StandardRange").glob("*.xosc"))


@pytest.mark.parametrize("layer", [Layer.STANDARD, Layer.EXTENDED])
@pytest.mark.parametrize("stem", NAMES_2026)
def test_2026_cells_are_those_of_the_files(stem: str, layer: Layer) -> None:
    folder = "StandardRange" if layer is Layer.STANDARD else "ExtendedRange"
    name, _, warning = stem.partition("_")
    function = Function.FCW if warning else Function.AEB
    cells = [c for c in EuroNcap2026().cells(name) if c.layer is layer and c.function is function]
    found: Counter[tuple[float | None, float | None, float | None, str]] = Counter()
    for parameters in variations(FILES / "CA-FC_2026/Variations" / folder / f"{stem}.xosc"):
        lighting = Lighting.NIGHT if parameters.get("LightingConditions") == "Night" else Lighting.DAY
        speed = number(parameters, "Ego_speed_kph")
        percent = number(parameters, "ImpactLocation")
        target = target_kmh(cells[0], parameters)
        found[speed, percent, target, lighting] += 1
    ours = Counter((c.speed_kmh, c.impact_percent, c.target_speed_kmh, c.lighting) for c in cells)
    approaches = 2 if name.endswith("scp") else 1  # from the far side and from the near side
    assert found == Counter({key: count * approaches for key, count in ours.items()})


def test_2023_pedestrian_and_cyclist_cells_are_those_of_the_files() -> None:
    found: set[tuple[str, float | None, float | None, float | None]] = set()
    runs = 0
    for path in sorted((FILES / "AEB_VRU_2023/Variations").glob("*.xosc")):
        match = re.match(r"NCAP_AEB_VRU_([A-Za-z]+(?:_C[ms])?)(?:[-_](25|50|75))?_", path.name)
        assert match is not None, path.name
        name, percent = match.groups()
        for parameters in variations(path):
            runs += 1
            where = number(parameters, "Overlap") or (float(percent) if percent else None)
            target = number(parameters, "Target_finalSpeed_kph") if name.endswith("tap") else None
            found.add((name, number(parameters, "Ego_speed_kph"), where, target))
    assert runs == 149  # 16 of them are one cell again
    ours = {
        (
            cell.scenario,
            cell.speed_kmh,
            None if cell.scenario == "CPRA_Cm" else cell.impact_percent,
            cell.target_speed_kmh if cell.scenario.endswith("tap") else None,
        )
        for cell in EuroNcap2023().cells()
        if not cell.scenario.startswith("CC")
    }
    assert ours == found
    assert len(ours) == 133


def test_2023_car_cells_are_those_of_the_files() -> None:
    found: set[tuple[str, float | None, float | None]] = set()
    for path in sorted((FILES / "AEB_C2C_2023/Variations").glob("*_Variation_2023.xosc")):
        name = path.name.split("_")[3]
        for parameters in variations(path):
            found.add((name, number(parameters, "Ego_speed_kph"), number(parameters, "Overlap")))
    ours = {
        (c.scenario, c.speed_kmh, c.impact_percent)
        for c in EuroNcap2023().cells()
        if c.scenario.startswith("CC")
    }
    assert ours == found
    assert len(EuroNcap2023().cells("CCRb")) == 4  # two gaps, two decelerations


def test_night_doubles_the_pedestrians_straight_ahead() -> None:
    """At night the table of CPNCO has 22 rows: eleven speeds by day, eleven by night."""
    night = EuroNcap2023(night=True)
    assert len(night.cells("CPNCO")) == 22
    assert len(night.cells()) - len(EuroNcap2023().cells()) == 22 + 11 + 11 + 9 + 7
