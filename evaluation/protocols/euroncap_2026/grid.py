"""Grid, points and verification counts of Euro NCAP 2026 Crash Avoidance - Frontal Collisions.

Sources: protocol v1.1 (October 2025), section 3.1, and Euro NCAP's calculator `euroncap-rating-2026` 5.4.9
(Apache-2.0), which follows v1.2 (July 2026). The pedestrian, cyclist, rear and most junction cells also agree
with Vector's OpenSCENARIO files of the protocol. CBTA and CCFhol have no such file.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from evaluation.protocols.grid import Block, Cell, Function, Layer, Lighting, labelled, matrix


class Criterion(StrEnum):
    """What decides a cell's colour (section 5.2)."""

    IMPACT_SPEED = "relative impact speed"
    AVOIDANCE = "avoidance"
    WARNING = "time to collision at the warning"
    REDUCTION = "speed reduction"


class Subelement(StrEnum):
    """Family of scenarios that is totalled."""

    CAR_PTW = "Car & PTW"
    PED_CYC = "Pedestrian & cyclist"


class Category(StrEnum):
    """Kind of conflict within a family."""

    LONGITUDINAL = "Longitudinal"
    TURNING = "Turning"
    CROSSING = "Crossing"


@dataclass(frozen=True, slots=True)
class Maxima:
    """Most points of a block, by layer."""

    standard: float
    extended: float
    robustness: float

    @property
    def total(self) -> float:
        """Of all layers."""
        return self.standard + self.extended + self.robustness


@dataclass(frozen=True, slots=True)
class ScoredBlock:
    """A matrix with what its score needs.

    Args:
        block: the cells.
        subelement, category: where its points are added up.
        partner: car, motorcyclist, pedestrian or cyclist.
        criterion: of its AEB cells; FCW cells go by the warning where `warning` is set.
        points: most points.
        drawn: standard cells that the laboratory draws for verification (section 4.2.1); extended: 2.
        warning: whether its FCW cells are judged by the warning; otherwise by the impact speed.
    """

    block: Block
    subelement: Subelement
    category: Category
    partner: str
    criterion: Criterion
    points: Maxima
    drawn: int = 3
    warning: bool = False

    def criterion_of(self, cell: Cell) -> Criterion:
        """What decides the colour of one of its cells."""
        if cell.function is Function.FCW and self.warning:
            return Criterion.WARNING
        # The AEB rows end here; a faster one is a row that may be FCW, declared AEB: it must avoid.
        if self.warning and cell.speed_kmh > _FASTEST_AEB_ROW_KMH:
            return Criterion.AVOIDANCE
        return self.criterion


EXTENDED_DRAWN = 2
"""Extended cells drawn for verification (section 4.2.1)."""

IMPACT = "impact location (%)"
TARGET = "target speed (km/h)"
VUT = "VUT (km/h)"

_PEDESTRIAN_KMH, _RUNNER_KMH = 5.0, 8.0
_FASTEST_AEB_ROW_KMH = 60.0


def blocks(choice: Function = Function.FCW) -> tuple[ScoredBlock, ...]:
    """All matrices of the protocol, in its order.

    Args:
        choice: what the manufacturer declares in the rows of CPLA, CBLA, CCRs and CMRs that may be either.
            Declared AEB, those of CPLA and CBLA at 50 and 60 km/h fall together with the AEB rows of these
            speeds, whose 25 % cells become standard instead.
    """
    return (*_car_blocks(choice), *_ped_blocks(choice))


def _car_blocks(choice: Function) -> Iterator[ScoredBlock]:
    """Cars and motorcycles: driven behind, met head on, while turning across their path, and in crossings."""
    kinds = {"CC": ("car", (125, 100, 75, 50, 25, 0, -25)), "CM": ("motorcyclist", (90, 75, 50, 25, 10))}
    for letters, (partner, columns) in kinds.items():
        inner = columns[1:-1]
        stationary = [
            _Line(v, inner, 0, function=choice if v >= 60 else Function.AEB) for v in range(10, 81, 10)
        ]
        braking = [_Line(v, inner if v <= 80 else (), v) for v in range(30, 131, 10)]
        moving = [_Line(v, inner, 20) for v in range(30, 81, 10)]
        moving += [_Line(v, inner, v - 60) for v in range(90, 131, 10)]
        rear = _Scoring(Category.LONGITUDINAL, partner, Criterion.IMPACT_SPEED)
        yield rear.block(f"{letters}Rs", columns, stationary, Maxima(1.2, 0.15, 0.15))
        if letters == "CC":
            yield rear.block("CCRm", columns, moving, Maxima(2.4, 0.3, 0.3))
        yield rear.block(f"{letters}Rb", columns, braking, Maxima(1.6, 0.2, 0.2))
    head_on = [
        _Line(v, (75, 50, 25) if v <= 80 else (), target)
        for v, target in zip(range(30, 101, 10), (50, 50, 50, 70, 70, 70, 90, 100), strict=True)
    ]
    for name in ("CCFhos", "CCFhol"):
        scoring = _Scoring(Category.LONGITUDINAL, "car", Criterion.REDUCTION, drawn=4)
        yield scoring.block(name, (100, 75, 50, 25), head_on, Maxima(2.0, 0.25, 0.25))
    turning = [_Line(v, (30, 45, 60) if v <= 20 else ()) for v in (10, 15, 20, 25)]
    both = (20, 30, 40, 50, 60)
    crossing = [
        *(_Line(v, both, extended=(70, 80)) for v in (20, 30)),
        *(_Line(v, both, extended=()) for v in (40, 50, 60)),
        *(_Line(v, (), extended=(20, 30)) for v in (70, 80)),
    ]
    for name, category, columns, lines, points, drawn in (
        ("Ftap", Category.TURNING, (30, 45, 60, 80), turning, Maxima(4.0, 0.5, 0.5), 3),
        ("Cscp", Category.CROSSING, (*both, 70, 80), crossing, Maxima(6.0, 0.75, 0.75), 5),
    ):
        for letters, (partner, _) in kinds.items():
            scoring = _Scoring(category, partner, Criterion.AVOIDANCE, drawn=drawn)
            yield scoring.block(f"{letters}{name}", columns, lines, points, by_target=True)


def _ped_blocks(choice: Function) -> Iterator[ScoredBlock]:
    """Pedestrians and cyclists: along the lane, at turns, and crossing."""
    ahead, percent = (75, 50, 25, 10), (90, 75, 50, 25, 10)
    walker, rider = (
        _Scoring(Category.LONGITUDINAL, partner, Criterion.IMPACT_SPEED, warning=True)
        for partner in ("pedestrian", "cyclist")
    )
    lines = _following(range(10, 61, 10), _PEDESTRIAN_KMH, _PEDESTRIAN_KMH, choice)
    yield from walker.by_light("CPLA", ahead, lines, Maxima(1.0, 0.125, 0.25))
    lines = _following(range(20, 61, 10), 15.0, 20.0, choice)
    yield rider.block("CBLA", ahead, lines, Maxima(2.0, 0.25, 0.25))
    yield from _turning()
    walker, rider = (
        _Scoring(Category.CROSSING, partner, Criterion.IMPACT_SPEED) for partner in ("pedestrian", "cyclist")
    )
    speeds = range(10, 61, 10)
    for name, target, columns, standard, points in (
        ("CPNA", _PEDESTRIAN_KMH, percent, (75, 50, 25), Maxima(0.5, 0.0625, 0.125)),
        ("CPFA", _RUNNER_KMH, percent, (50,), Maxima(0.5, 0.0625, 0.125)),
        ("CPNCO", _PEDESTRIAN_KMH, (75, 50, 25), (50,), Maxima(1.0, 0.125, 0.25)),
    ):
        yield from walker.by_light(name, columns, [_Line(v, standard, target) for v in speeds], points)
    for name, target, middle, points in (
        ("CBNA", 15.0, (75, 50), Maxima(1.0, 0.125, 0.125)),
        ("CBFA", 20.0, (50, 25), Maxima(1.0, 0.125, 0.125)),
        ("CBNAO", 10.0, (75, 50), Maxima(2.0, 0.25, 0.25)),
    ):
        yield rider.block(name, percent, [_Line(v, middle, target) for v in speeds], points)


def _turning() -> Iterator[ScoredBlock]:
    """CPTA and CBTA: turning to far (f) or near side (n), target in same (s) or opposite direction (o)."""
    percent = (90, 75, 50, 25, 10)
    walker = _turns((50,), (50,), percent, percent)
    plans: tuple[tuple[str, str, float, str, Sequence[float], list[_Line]], ...] = (
        ("CPTA", "pedestrian", _PEDESTRIAN_KMH, "s", percent, walker),
        ("CPTA", "pedestrian", _PEDESTRIAN_KMH, "o", percent, walker),
        ("CBTA", "cyclist", 15.0, "s", (100, 75, 0), _turns((100,), (0,), (100, 75), (75, 0))),
        ("CBTA", "cyclist", 15.0, "o", percent, _turns((50,), (50,), percent, (75, 50, 25))),
    )
    for name, partner, target, direction, columns, lines in plans:
        far, near = f"{name}f{direction}", f"{name}n{direction}"
        named = [replace(line, target=target, scenario=near if line.near else far) for line in lines]
        scoring = _Scoring(Category.TURNING, partner, Criterion.AVOIDANCE)
        points = Maxima(1.0, 0.125, 0.125)
        yield scoring.block(f"{far} & {near}", columns, named, points, scenario=name)


@dataclass(frozen=True, slots=True)
class _Line:
    """One VUT speed of a matrix: its standard columns, and its extended ones (None: all others)."""

    speed: float
    standard: Sequence[float]
    target: float | None = None
    extended: Sequence[float] | None = None
    scenario: str = ""
    function: Function = Function.AEB
    near: bool = False

    @property
    def label(self) -> str:
        """What stands left of it."""
        function = "" if self.function is Function.AEB else str(self.function)
        return " ".join(filter(None, (self.scenario, f"{self.speed:g}", function)))


_PARTNERS = {
    **dict.fromkeys(("car", "motorcyclist"), Subelement.CAR_PTW),
    **dict.fromkeys(("pedestrian", "cyclist"), Subelement.PED_CYC),
}


@dataclass(frozen=True, slots=True)
class _Scoring:
    """What the matrices of one kind have in common; see `ScoredBlock`."""

    category: Category
    partner: str
    criterion: Criterion
    drawn: int = 3
    warning: bool = False

    def block(
        self,
        name: str,
        columns: Sequence[float],
        lines: Iterable[_Line],
        points: Maxima,
        lighting: Lighting = Lighting.DAY,
        scenario: str = "",
        by_target: bool = False,
    ) -> ScoredBlock:
        """A matrix with its score; its scenario has its name unless another is given."""

        def cell(line: _Line, column: float) -> Cell | None:
            standard = column in line.standard
            if not standard and line.extended is not None and column not in line.extended:
                return None
            target = column if by_target else line.target
            return Cell(
                line.scenario or scenario or name,
                float(line.speed),
                None if by_target else float(column),
                None if target is None else float(target),
                lighting,
                line.function,
                Layer.STANDARD if standard else Layer.EXTENDED,
            )

        headers, by_label = (VUT, TARGET if by_target else IMPACT), {line.label: line for line in lines}
        block = matrix(name, headers, by_label, labelled(columns), cell, scenario)
        family = _PARTNERS[self.partner]
        kind = (family, self.category, self.partner, self.criterion)
        return ScoredBlock(block, *kind, points, self.drawn, self.warning)

    def by_light(
        self, name: str, columns: Sequence[float], lines: Sequence[_Line], points: Maxima
    ) -> Iterator[ScoredBlock]:
        """The matrix by day and by night; the points for robustness belong to the day (calculator)."""
        for lighting in Lighting:
            most = points if lighting is Lighting.DAY else replace(points, robustness=0.0)
            yield self.block(f"{name} {lighting}", columns, lines, most, lighting, name)


def _turns(
    far: Sequence[float], near: Sequence[float], far_columns: Sequence[float], near_columns: Sequence[float]
) -> list[_Line]:
    """Rows of turns to the far side, then that of the near side; what is not standard is extended."""
    return [
        *(_Line(v, far, extended=far_columns) for v in (10, 15, 20)),
        _Line(25, (), extended=far_columns),
        _Line(10, near, extended=near_columns, near=True),
    ]


def _following(speeds: Iterable[float], target: float, warned: float, choice: Function) -> list[_Line]:
    """Rows of CPLA and CBLA: AEB rows at 50 %, then the rows at 25 % that may be declared FCW or AEB."""
    merged = choice is Function.AEB
    lines = [_Line(v, (50, 25) if merged and v in (50, 60) else (50,), target) for v in speeds]
    return lines + [
        _Line(v, (25,), warned, function=choice) for v in ((70, 80) if merged else range(50, 81, 10))
    ]
