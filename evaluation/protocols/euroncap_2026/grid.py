"""Grid, points and verification counts of Euro NCAP 2026 Crash Avoidance - Frontal Collisions.

Sources: protocol v1.1 (October 2025), section 3.1, and Euro NCAP's calculator `euroncap-rating-2026` 5.4.9
(Apache-2.0), which follows v1.2 (July 2026). The pedestrian, cyclist, rear and most junction cells also agree
with Vector's OpenSCENARIO files of the protocol. CBTA and CCFhol have no such file.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from evaluation.protocols.grid import Block, Cell, Function, Layer, Lighting, Row


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


def _car_blocks(choice: Function) -> Iterable[ScoredBlock]:
    rear = (125, 100, 75, 50, 25, 0, -25)
    bike = (90, 75, 50, 25, 10)
    partners = (("CC", "car", rear), ("CM", "motorcyclist", bike))
    for letters, partner, columns in partners:
        inner = columns[1:-1]
        stationary = [
            _Line(v, inner, 0, function=choice if v >= 60 else Function.AEB) for v in range(10, 81, 10)
        ]
        braking = [_Line(v, inner if v <= 80 else (), v) for v in range(30, 131, 10)]
        moving = [_Line(v, inner, 20) for v in range(30, 81, 10)]
        moving += [_Line(v, inner, v - 60) for v in range(90, 131, 10)]
        yield _rear(f"{letters}Rs", partner, columns, stationary, Maxima(1.2, 0.15, 0.15))
        if letters == "CC":
            yield _rear("CCRm", partner, columns, moving, Maxima(2.4, 0.3, 0.3))
        yield _rear(f"{letters}Rb", partner, columns, braking, Maxima(1.6, 0.2, 0.2))
    head_on = [
        _Line(v, (75, 50, 25) if v <= 80 else (), target)
        for v, target in zip(range(30, 101, 10), (50, 50, 50, 70, 70, 70, 90, 100), strict=True)
    ]
    for name, drawn in (("CCFhos", 4), ("CCFhol", 4)):
        yield ScoredBlock(
            _block(name, name, (100, 75, 50, 25), head_on),
            Subelement.CAR_PTW,
            Category.LONGITUDINAL,
            "car",
            Criterion.REDUCTION,
            Maxima(2.0, 0.25, 0.25),
            drawn,
        )
    for letters, partner in (("CC", "car"), ("CM", "motorcyclist")):
        turning = [_Line(v, (30, 45, 60) if v <= 20 else ()) for v in (10, 15, 20, 25)]
        yield ScoredBlock(
            _block(f"{letters}Ftap", f"{letters}Ftap", (30, 45, 60, 80), turning, by_target=True),
            Subelement.CAR_PTW,
            Category.TURNING,
            partner,
            Criterion.AVOIDANCE,
            Maxima(4.0, 0.5, 0.5),
        )
    for letters, partner in (("CC", "car"), ("CM", "motorcyclist")):
        both = (20, 30, 40, 50, 60)
        crossing = [_Line(v, both, extended=(70, 80)) for v in (20, 30)]
        crossing += [_Line(v, both, extended=()) for v in (40, 50, 60)]
        crossing += [_Line(v, (), extended=(20, 30)) for v in (70, 80)]
        yield ScoredBlock(
            _block(f"{letters}Cscp", f"{letters}Cscp", (*both, 70, 80), crossing, by_target=True),
            Subelement.CAR_PTW,
            Category.CROSSING,
            partner,
            Criterion.AVOIDANCE,
            Maxima(6.0, 0.75, 0.75),
            drawn=5,
        )


def _ped_blocks(choice: Function) -> Iterable[ScoredBlock]:
    for lighting in Lighting:
        points = Maxima(1.0, 0.125, _by_day(0.25, lighting))
        lines = _following(range(10, 61, 10), _PEDESTRIAN_KMH, _PEDESTRIAN_KMH, choice)
        block = _block(f"CPLA {lighting}", "CPLA", (75, 50, 25, 10), lines, lighting)
        yield _longitudinal(block, "pedestrian", points)
    lines = _following(range(20, 61, 10), 15.0, 20.0, choice)
    block = _block("CBLA", "CBLA", (75, 50, 25, 10), lines)
    yield _longitudinal(block, "cyclist", Maxima(2.0, 0.25, 0.25))
    yield from _turning()
    percent = (90, 75, 50, 25, 10)
    for name, target, columns, standard, most in (
        ("CPNA", _PEDESTRIAN_KMH, percent, (75, 50, 25), Maxima(0.5, 0.0625, 0.125)),
        ("CPFA", _RUNNER_KMH, percent, (50,), Maxima(0.5, 0.0625, 0.125)),
        ("CPNCO", _PEDESTRIAN_KMH, (75, 50, 25), (50,), Maxima(1.0, 0.125, 0.25)),
    ):
        for lighting in Lighting:
            lines = [_Line(v, standard, target) for v in range(10, 61, 10)]
            points = Maxima(most.standard, most.extended, _by_day(most.robustness, lighting))
            yield _crossing(
                _block(f"{name} {lighting}", name, columns, lines, lighting), "pedestrian", points
            )
    for name, target, columns, middle, most in (
        ("CBNA", 15.0, percent, (75, 50), Maxima(1.0, 0.125, 0.125)),
        ("CBFA", 20.0, percent, (50, 25), Maxima(1.0, 0.125, 0.125)),
        ("CBNAO", 10.0, percent, (75, 50), Maxima(2.0, 0.25, 0.25)),
    ):
        lines = [_Line(v, middle, target) for v in range(10, 61, 10)]
        yield _crossing(_block(name, name, columns, lines), "cyclist", most)


def _turning() -> Iterable[ScoredBlock]:
    """CPTA and CBTA: turning to far (f) or near side (n), target in same (s) or opposite direction (o)."""
    percent = (90, 75, 50, 25, 10)
    plans: tuple[tuple[str, str, float, str, Sequence[float], list[_Line]], ...] = (
        ("CPTA", "pedestrian", _PEDESTRIAN_KMH, "s", percent, _turns((50,), (50,), percent, percent)),
        ("CPTA", "pedestrian", _PEDESTRIAN_KMH, "o", percent, _turns((50,), (50,), percent, percent)),
        ("CBTA", "cyclist", 15.0, "s", (100, 75, 0), _turns((100,), (0,), (100, 75), (75, 0))),
        ("CBTA", "cyclist", 15.0, "o", percent, _turns((50,), (50,), percent, (75, 50, 25))),
    )
    for name, partner, target, direction, columns, lines in plans:
        far, near = f"{name}f{direction}", f"{name}n{direction}"
        named = [_Line(r.speed, r.standard, target, r.extended, near if r.near else far) for r in lines]
        yield ScoredBlock(
            _block(f"{far} & {near}", name, columns, named),
            Subelement.PED_CYC,
            Category.TURNING,
            partner,
            Criterion.AVOIDANCE,
            Maxima(1.0, 0.125, 0.125),
        )


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


def _turns(
    far: Sequence[float], near: Sequence[float], far_columns: Sequence[float], near_columns: Sequence[float]
) -> list[_Line]:
    def others(columns: Sequence[float], standard: Sequence[float]) -> tuple[float, ...]:
        return tuple(c for c in columns if c not in standard)

    lines = [_Line(v, far, extended=others(far_columns, far)) for v in (10, 15, 20)]
    lines.append(_Line(25, (), extended=far_columns))
    return [*lines, _Line(10, near, extended=others(near_columns, near), near=True)]


def _following(speeds: Iterable[float], target: float, warned: float, choice: Function) -> list[_Line]:
    """Rows of CPLA and CBLA: AEB rows at 50 %, then the rows at 25 % that may be declared FCW or AEB."""
    merged = choice is Function.AEB
    lines = [_Line(v, (50, 25) if merged and v in (50, 60) else (50,), target) for v in speeds]
    return lines + [
        _Line(v, (25,), warned, function=choice) for v in ((70, 80) if merged else range(50, 81, 10))
    ]


def _block(
    name: str,
    scenario: str,
    columns: Sequence[float],
    lines: Iterable[_Line],
    lighting: Lighting = Lighting.DAY,
    *,
    by_target: bool = False,
) -> Block:
    rows = []
    for line in lines:
        others = line.extended if line.extended is not None else columns
        cells = tuple(
            Cell(
                line.scenario or scenario,
                float(line.speed),
                None if by_target else float(column),
                float(column) if by_target else None if line.target is None else float(line.target),
                lighting,
                line.function,
                Layer.STANDARD if column in line.standard else Layer.EXTENDED,
            )
            if column in line.standard or column in others
            else None
            for column in columns
        )
        words = [
            line.scenario,
            f"{line.speed:g}",
            "" if line.function is Function.AEB else str(line.function),
        ]
        rows.append(Row(" ".join(filter(None, words)), cells))
    header = TARGET if by_target else IMPACT
    return Block(name, scenario, VUT, header, tuple(f"{c:g}" for c in columns), tuple(rows))


def _rear(
    name: str, partner: str, columns: Sequence[float], lines: Iterable[_Line], points: Maxima
) -> ScoredBlock:
    return ScoredBlock(
        _block(name, name, columns, lines),
        Subelement.CAR_PTW,
        Category.LONGITUDINAL,
        partner,
        Criterion.IMPACT_SPEED,
        points,
    )


def _longitudinal(block: Block, partner: str, points: Maxima) -> ScoredBlock:
    return ScoredBlock(
        block,
        Subelement.PED_CYC,
        Category.LONGITUDINAL,
        partner,
        Criterion.IMPACT_SPEED,
        points,
        warning=True,
    )


def _crossing(block: Block, partner: str, points: Maxima) -> ScoredBlock:
    return ScoredBlock(block, Subelement.PED_CYC, Category.CROSSING, partner, Criterion.IMPACT_SPEED, points)


def _by_day(most: float, lighting: Lighting) -> float:
    """Points for robustness belong to the matrix driven by day (calculator)."""
    return most if lighting is Lighting.DAY else 0.0
