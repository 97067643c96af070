"""What the paper's test came to, in sentences worked out from the tables."""

from __future__ import annotations

from collections.abc import Sequence

from evaluation.protocols.paper import PUBLISHED, PUBLISHED_FLAG_S
from evaluation.results.rows import RunRow
from evaluation.results.tables import Table
from evaluation.studies.reference.mechanisms import CONDITIONS, Condition, MechanismRun
from evaluation.studies.reference.words import counted, listed, span
from scenarios.settings import settings_text

STRATEGIES = tuple(PUBLISHED)
"""The paper's rectangle and its map."""

PRINTED_KMH = 0.05
"""Impact speeds that differ by less are the same in print."""

Impacts = dict[tuple[str, float], float]
"""Impact speed in km/h by strategy and test speed in km/h."""


def impacts(rows: Sequence[RunRow], weather: str = "dry") -> Impacts:
    """Impact speeds of one weather."""
    return {
        (row.strategy, row.v_test_kmh): row.v_impact_kmh
        for row in rows
        if row.weather == weather and row.v_impact_kmh is not None
    }


def hit_speeds(ours: Impacts, strategy: str) -> list[float]:
    """Test speeds at which a strategy ends in a contact."""
    return [speed for (name, speed), impact in sorted(ours.items()) if name == strategy and impact > 0.0]


def score_text(rows: Sequence[RunRow], strategy: str, weather: str = "dry") -> str:
    """Points of a strategy over those to be won."""
    scored = [row for row in rows if (row.strategy, row.weather) == (strategy, weather)]
    won = sum(row.score for row in scored if row.score is not None)
    most = sum(row.score_max for row in scored if row.score_max is not None)
    return f"{round(won, 2):g} of {most:g}"


def _scores(rows: Sequence[RunRow], weather: str = "dry") -> str:
    return listed(f"{score_text(rows, name, weather)} ({name})" for name in STRATEGIES)


# ---- table I and figure 5 ----------------------------------------------------------------------------------


def _flags_s(rows: Sequence[RunRow]) -> list[tuple[float, float, float]]:
    """Test speed in km/h, time from the map's flag to T0 in s, and the same of figure 5b."""
    return [
        (row.v_test_kmh, row.t0_s - row.flag_time_s, PUBLISHED_FLAG_S[row.v_test_kmh])
        for row in rows
        if row.strategy == "map" and row.flag_time_s is not None and row.t0_s is not None
    ]


def flag_table(rows: Sequence[RunRow]) -> Table:
    """Time from the flag to stop or contact beside the crosses of figure 5b."""
    lines = [
        (f"{v:g}", f"{ours:.2f}", f"{published:.2f}", f"{ours - published:+.2f}")
        for v, ours, published in _flags_s(rows)
    ]
    return Table(("v_test (km/h)", "flag before T0 (s)", "figure 5b (s)", "diff. (s)"), tuple(lines))


def told_table_one(rows: Sequence[RunRow]) -> list[str]:
    """Whether table I and figure 5b come out."""
    ours = impacts(rows)
    cells = [((name, v), impact) for name, column in PUBLISHED.items() for v, (impact, _) in column.items()]
    different = [cell for cell, impact in cells if (ours[cell] > 0.0) != (impact > 0.0)]
    agreement = f"Contact or none agrees with the paper in all {len(cells)} published cells."
    if different:
        where = listed(f"{name} at {v:g} km/h" for name, v in different)
        agreement = (
            f"Contact or none differs from the paper in {len(different)} of {len(cells)} cells: {where}."
        )
    totals = [sum(score or 0.0 for _, score in column.values()) for column in PUBLISHED.values()]
    lines = [f"{agreement} The scores are {_scores(rows)}; the paper has {listed(totals)}."]
    both = [ours[cell] - impact for cell, impact in cells if impact > 0.0 < ours[cell]]
    if both:
        side = "above" if min(both) > 0.0 else "below" if max(both) < 0.0 else "away from"
        sizes = span([abs(difference) for difference in both], 1)
        lines.append(
            f"The {len(both)} impact speeds that both have are {sizes} km/h {side} the published ones."
        )
    flags = [flag - published for _, flag, published in _flags_s(rows)]
    if flags:
        early = sum(difference > 0.0 for difference in flags)
        lines.append(
            f"At {counted(early, len(flags))} speeds the map's flag is longer before T0 than the cross "
            f"of figure 5b; the differences are {span(flags, 2)} s."
        )
    return lines


def _changed(
    alone: Sequence[RunRow], others: Sequence[RunRow]
) -> dict[tuple[str, float], tuple[float, float]]:
    """Impact speeds alone and among others, where they differ in print."""
    before, after = impacts(alone), impacts(others)
    return {
        cell: (before[cell], after[cell]) for cell in after if abs(after[cell] - before[cell]) > PRINTED_KMH
    }


def told_others(alone: Sequence[RunRow], others: Sequence[RunRow]) -> list[str]:
    """What static adversaries change (figure 5c, d)."""
    changed = _changed(alone, others)
    if not changed:
        speeds = listed(sorted({speed for _, speed in impacts(others)}))
        return [
            f"At {speeds} km/h parked cars and standing people change no impact speed of either strategy."
        ]
    texts = [f"{name} at {v:g} km/h from {a:.1f} to {b:.1f}" for (name, v), (a, b) in changed.items()]
    return [f"Parked cars and standing people change impact speeds (km/h): {listed(texts)}."]


# ---- mechanisms --------------------------------------------------------------------------------------------


def _of(runs: Sequence[MechanismRun], condition: Condition, speed: float | None = None) -> list[float]:
    """Impact speeds under a condition."""
    who = (condition.strategy, settings_text(condition.settings))
    return [
        run.v_impact_kmh
        for run in runs
        if (run.strategy, run.settings) == who and speed in (None, run.v_test_kmh)
    ]


def told_mechanisms(runs: Sequence[MechanismRun]) -> list[str]:
    """Which condition makes which published number."""
    rectangle, usual_map, clamps, blind, free = CONDITIONS
    lines = []
    hits = [v for v in rectangle.speeds_kmh if max(_of(runs, rectangle, v)) > 0.0]
    if hits and not any(_of(runs, clamps)):
        lines.append(
            f"With the authors' own clamps of 12 to 30 m the rectangle avoids every collision at "
            f"{listed(clamps.speeds_kmh)} km/h; held at 12 m it hits at {listed(hits)} km/h."
        )
    far = [v for v in usual_map.speeds_kmh if min(_of(runs, usual_map, v)) > 0.0]
    if far and not any(_of(runs, free)):
        lines.append(
            f"Without a limit on its reach the map avoids the collision at {listed(far)} km/h too, where "
            "with 22.2 m it always hits."
        )
    late = [
        v for v in blind.speeds_kmh if max(_of(runs, blind, v)) > 0.0 and min(_of(runs, usual_map, v)) == 0.0
    ]
    if late:
        sizes = span([impact for v in late for impact in _of(runs, blind, v)], 0)
        lines.append(
            f"If 22.2 m limit what is seen instead of what counts, there is contact at {listed(late)} km/h "
            f"as well ({sizes} km/h), which the paper did not see: a track without a velocity raises no flag."
        )
    for condition, v in ((c, v) for c in (rectangle, usual_map) for v in c.speeds_kmh):
        at_speed = _of(runs, condition, v)
        touched, spread_kmh = sum(impact > 0.0 for impact in at_speed), max(at_speed) - min(at_speed)
        if 0 < touched < len(at_speed):
            lines.append(
                f"The frames' phase decides at {v:g} km/h ({condition.strategy}): contact in "
                f"{touched} of {len(at_speed)} runs, at up to {max(at_speed):.1f} km/h."
            )
        elif touched and spread_kmh > 1.0:
            lines.append(
                f"The frames' phase and noise are worth {spread_kmh:.1f} km/h at {v:g} km/h "
                f"({condition.strategy}, {span(at_speed, 1)} km/h)."
            )
    return lines


# ---- a real car --------------------------------------------------------------------------------------------


def told_physical(rows: Sequence[RunRow]) -> list[str]:
    """Where the map helps with the brakes and the sensor of a real car."""
    ours = impacts(rows)
    speeds = sorted({speed for _, speed in ours})
    gain = {v: ours["rectangular", v] - ours["map", v] for v in speeds}
    helps = [v for v in speeds if gain[v] > PRINTED_KMH]
    harms = [v for v in speeds if gain[v] < -PRINTED_KMH]
    alike = [v for v in speeds if v not in helps and v not in harms]
    lines = []
    if helps:
        of_rectangle, of_map = (
            listed(f"{ours[name, v]:.1f}" for v in helps if ours[name, v]) for name in STRATEGIES
        )
        outcome = f"with the map at {of_map}" if of_map else "the map avoids the collision"
        lines.append(
            f"The map helps at {listed(helps)} km/h: with the rectangle impacts are at {of_rectangle} km/h, "
            f"{outcome}."
        )
    if harms:
        lines.append(f"The map is worse at {listed(harms)} km/h.")
    if alike:
        lines.append(f"At {listed(alike)} km/h both end alike.")
    same = score_of_both(rows)
    if same:
        return [*lines, f"Both score {same}: the score, which ends at 60 km/h, sees no difference."]
    return [*lines, f"The scores are {_scores(rows)}."]


def score_of_both(rows: Sequence[RunRow]) -> str:
    """The score of both strategies if it is the same, else empty."""
    first, *more = {score_text(rows, name) for name in STRATEGIES}
    return "" if more else first


def told_weather(rows: Sequence[RunRow]) -> list[str]:
    """What weather changes, and whether the map changes that."""
    lines = []
    for weather in dict.fromkeys(row.weather for row in rows):
        ours = impacts(rows, weather)
        hits = {name: hit_speeds(ours, name) for name in STRATEGIES}
        texts = [
            f"{name} hits at {listed(f'{v:g} ({ours[name, v]:.1f})' for v in speeds)} km/h"
            if speeds
            else f"{name} never hits"
            for name, speeds in hits.items()
        ]
        outcome = f": {listed(texts)}; " if any(hits.values()) else ": no contact; "
        lines.append(f"{weather.capitalize()}{outcome}{_scores(rows, weather)}.")
    return lines


def odd_weathers(rows: Sequence[RunRow]) -> list[str]:
    """Weathers in which a strategy hits at one speed and not at a higher one."""

    def is_odd(ours: Impacts, name: str) -> bool:
        hits = hit_speeds(ours, name)
        return bool(hits) and any(v > hits[0] and v not in hits for strategy, v in ours if strategy == name)

    weathers = dict.fromkeys(row.weather for row in rows)
    return [w for w in weathers if any(is_odd(impacts(rows, w), name) for name in STRATEGIES)]


# ---- in short ----------------------------------------------------------------------------------------------


def told_in_short(
    rows: Sequence[RunRow], mechanisms: Sequence[MechanismRun], physical: Sequence[RunRow]
) -> list[str]:
    """The findings that a reader should take away."""
    first, *_ = told_table_one(rows)
    lines = [f"The paper's table: {first[0].lower()}{first[1:]}"]
    lines += told_reach(mechanisms)
    lines.append(f"The paper's test with a real car: {' '.join(told_physical(physical)[:2])}")
    return lines


def told_reach(mechanisms: Sequence[MechanismRun]) -> list[str]:
    """What the published gap comes from, if it is reach."""
    if not is_reach(mechanisms):
        return []
    return [
        "The paper's gap between rectangle and map is a gap in reach: an object counts 12 m ahead in the one "
        "and 22.2 m ahead in the other. Given the authors' own 30 m, the rectangle avoids the collision as "
        "well."
    ]


def is_reach(runs: Sequence[MechanismRun]) -> bool:
    """Whether the rectangle hits at its lower clamp and at no speed with the authors' own clamps."""
    rectangle, _, clamps, _, _ = CONDITIONS
    return any(_of(runs, rectangle)) and not any(_of(runs, clamps))


def contradictions(
    alone: Sequence[RunRow],
    others: Sequence[RunRow],
    mechanisms: Sequence[MechanismRun],
    physical: Sequence[RunRow],
) -> list[str]:
    """Statements of the paper that did not come out in its own test."""
    lines = []
    if is_reach(mechanisms):
        lines.append(
            "The paper credits the map's semantics with the time gained. On its straight road the gain is "
            "the reach alone; see *What makes the numbers*."
        )
    if not _changed(alone, others):
        lines.append(
            "The paper says that the rectangle suffers when others are around. Static others change none of "
            "its impact speeds here: none is on a collision course, and both strategies share one forecast."
        )
    phases = _of(mechanisms, CONDITIONS[1], 70.0)
    touched = [impact for impact in phases if impact > 0.0]
    if touched:
        lines.append(
            f"The paper's map avoids the collision up to 70 km/h. Here that depends on the frames' phase: "
            f"contact in {len(touched)} of {len(phases)} runs, at up to {max(touched):.1f} km/h."
        )
    if same := score_of_both(physical):
        lines.append(
            f"The paper's map scores more than its rectangle. With a real car and the authors' own clamps "
            f"both score {same}."
        )
    return lines
