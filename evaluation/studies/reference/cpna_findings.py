"""What the paper's test came to, in sentences worked out from the tables."""

from __future__ import annotations

from collections.abc import Sequence

from evaluation.protocols.paper import PUBLISHED, PUBLISHED_FLAG_S
from evaluation.results.rows import RunRow
from evaluation.results.tables import Table
from evaluation.studies.reference.mechanisms import CONDITIONS, Condition, MechanismRun
from evaluation.studies.reference.words import counted, listed, span
from scenarios.settings import settings_text

Impacts = dict[tuple[str, float], float]
"""Impact speed in km/h by strategy and test speed in km/h."""


def impacts(rows: Sequence[RunRow], weather: str = "dry") -> Impacts:
    """Impact speeds of one weather."""
    return {
        (row.strategy, row.v_test_kmh): row.v_impact_kmh
        for row in rows
        if row.weather == weather and row.v_impact_kmh is not None
    }


def hit_speeds(found: Impacts, strategy: str) -> list[float]:
    """Test speeds at which a strategy ends in a contact."""
    return [speed for (name, speed), impact in sorted(found.items()) if name == strategy and impact > 0.0]


def score_text(rows: Sequence[RunRow], strategy: str, weather: str = "dry") -> str:
    """Points of a strategy over those to be won."""
    mine = [row for row in rows if (row.strategy, row.weather) == (strategy, weather)]
    won = sum(row.score for row in mine if row.score is not None)
    most = sum(row.score_max for row in mine if row.score_max is not None)
    return f"{round(won, 2):g} of {most:g}"


# ---- table I and figure 5 ----------------------------------------------------------------------------------


def flag_table(rows: Sequence[RunRow]) -> Table:
    """Time from the flag to stop or contact beside the crosses of figure 5b."""
    lines = []
    for row in rows:
        if row.strategy == "map" and row.flag_time_s is not None and row.t0_s is not None:
            ours, published = row.t0_s - row.flag_time_s, PUBLISHED_FLAG_S[row.v_test_kmh]
            lines.append(
                (f"{row.v_test_kmh:g}", f"{ours:.2f}", f"{published:.2f}", f"{ours - published:+.2f}")
            )
    return Table(("v_test (km/h)", "flag before T0 (s)", "figure 5b (s)", "diff. (s)"), tuple(lines))


def told_table_one(rows: Sequence[RunRow]) -> list[str]:
    """Whether table I and figure 5b come out."""
    found = impacts(rows)
    cells = [(name, v, impact) for name, column in PUBLISHED.items() for v, (impact, _) in column.items()]
    other = [(name, v) for name, v, impact in cells if (found[name, v] > 0.0) != (impact > 0.0)]
    if other:
        where = listed(f"{name} at {v:g} km/h" for name, v in other)
        first = f"Contact or none differs from the paper in {len(other)} of {len(cells)} cells: {where}."
    else:
        first = f"Contact or none agrees with the paper in all {len(cells)} published cells."
    scores = listed(f"{score_text(rows, name)} ({name})" for name in PUBLISHED)
    totals = listed(
        f"{sum(score for _, score in column.values() if score is not None):g}"
        for column in PUBLISHED.values()
    )
    lines = [f"{first} The scores are {scores}; the paper has {totals}."]
    both = [found[name, v] - impact for name, v, impact in cells if impact > 0.0 < found[name, v]]
    if both:
        side = "above" if min(both) > 0.0 else "below" if max(both) < 0.0 else "away from"
        sizes = span([abs(difference) for difference in both], 1)
        lines.append(
            f"The {len(both)} impact speeds that both have are {sizes} km/h {side} the published ones."
        )
    flags = {
        row.v_test_kmh: row.t0_s - row.flag_time_s - PUBLISHED_FLAG_S[row.v_test_kmh]
        for row in rows
        if row.strategy == "map" and row.flag_time_s is not None and row.t0_s is not None
    }
    if flags:
        early = [difference for difference in flags.values() if difference > 0.0]
        lines.append(
            f"At {counted(len(early), len(flags))} speeds the map's flag is longer before T0 than the cross "
            f"of figure 5b; the differences are {span(list(flags.values()), 2)} s."
        )
    return lines


def told_others(alone: Sequence[RunRow], others: Sequence[RunRow]) -> list[str]:
    """What static adversaries change (figure 5c, d)."""
    before, after = impacts(alone), impacts(others)
    changed = {
        key: (before[key], impact) for key, impact in after.items() if abs(impact - before[key]) > 0.05
    }
    speeds = listed(sorted({speed for _, speed in after}))
    if not changed:
        return [
            f"At {speeds} km/h parked cars and standing people change no impact speed of either strategy."
        ]
    texts = [f"{name} at {v:g} km/h from {a:.1f} to {b:.1f}" for (name, v), (a, b) in changed.items()]
    return [f"Parked cars and standing people change impact speeds (km/h): {listed(texts)}."]


# ---- mechanisms --------------------------------------------------------------------------------------------


def _of(runs: Sequence[MechanismRun], condition: Condition, speed: float | None = None) -> list[float]:
    text = settings_text(condition.settings)
    return [
        run.v_impact_kmh
        for run in runs
        if (run.strategy, run.settings) == (condition.strategy, text) and speed in (None, run.v_test_kmh)
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
        sizes = span([speed for v in late for speed in _of(runs, blind, v)], 0)
        lines.append(
            f"If 22.2 m limit what is seen instead of what counts, there is contact at {listed(late)} km/h "
            f"as well ({sizes} km/h), which the paper did not see: a track without a velocity raises no flag."
        )
    for condition in (rectangle, usual_map):
        for v in condition.speeds_kmh:
            found = _of(runs, condition, v)
            touched = sum(impact > 0.0 for impact in found)
            if 0 < touched < len(found):
                lines.append(
                    f"The frames' phase decides at {v:g} km/h ({condition.strategy}): contact in "
                    f"{touched} of {len(found)} runs, at up to {max(found):.1f} km/h."
                )
            elif touched and max(found) - min(found) > 1.0:
                lines.append(
                    f"The frames' phase and noise are worth {max(found) - min(found):.1f} km/h at {v:g} km/h "
                    f"({condition.strategy}, {span(found, 1)} km/h)."
                )
    return lines


# ---- a real car --------------------------------------------------------------------------------------------


def told_physical(rows: Sequence[RunRow]) -> list[str]:
    """Where the map helps with the brakes and the sensor of a real car."""
    found = impacts(rows)
    speeds = sorted({speed for _, speed in found})
    hits = {name: hit_speeds(found, name) for name in ("rectangular", "map")}
    helps = [v for v in hits["rectangular"] if found["map", v] < found["rectangular", v] - 0.05]
    harms = [v for v in hits["map"] if found["rectangular", v] < found["map", v] - 0.05]
    same = [v for v in speeds if v not in helps and v not in harms]
    lines = []
    if helps:
        there, here = (
            listed(f"{found[name, v]:.1f}" for v in helps if found[name, v])
            for name in ("rectangular", "map")
        )
        rest = f"with the map at {here}" if here else "the map avoids the collision"
        lines.append(
            f"The map helps at {listed(helps)} km/h: with the rectangle impacts are at {there} km/h, {rest}."
        )
    if harms:
        lines.append(f"The map is worse at {listed(harms)} km/h.")
    if same:
        lines.append(f"At {listed(same)} km/h both end alike.")
    scores = {name: score_text(rows, name) for name in hits}
    if len(set(scores.values())) == 1:
        lines.append(f"Both score {scores['map']}: the score, which ends at 60 km/h, sees no difference.")
    else:
        lines.append(f"The scores are {listed(f'{text} ({name})' for name, text in scores.items())}.")
    return lines


def told_weather(rows: Sequence[RunRow]) -> list[str]:
    """What weather changes, and whether the map changes that."""
    lines = []
    weathers = list(dict.fromkeys(row.weather for row in rows))
    for weather in weathers:
        found = impacts(rows, weather)
        hits = {name: hit_speeds(found, name) for name in ("rectangular", "map")}
        scores = listed(f"{score_text(rows, name, weather)} ({name})" for name in ("rectangular", "map"))
        if not any(hits.values()):
            lines.append(f"{weather.capitalize()}: no contact; {scores}.")
            continue
        texts = [
            f"{name} hits at {listed(f'{v:g} ({found[name, v]:.1f})' for v in speeds)} km/h"
            if speeds
            else f"{name} never hits"
            for name, speeds in hits.items()
        ]
        lines.append(f"{weather.capitalize()}: {listed(texts)}; {scores}.")
    return lines


def odd_weathers(rows: Sequence[RunRow]) -> list[str]:
    """Weathers in which a strategy hits at one speed and not at a higher one."""
    odd = []
    for weather in dict.fromkeys(row.weather for row in rows):
        found = impacts(rows, weather)
        for name in ("rectangular", "map"):
            speeds = sorted(v for strategy, v in found if strategy == name)
            hits = hit_speeds(found, name)
            if hits and any(v > hits[0] and v not in hits for v in speeds):
                odd.append(weather)
    return list(dict.fromkeys(odd))


# ---- in short ----------------------------------------------------------------------------------------------


def told_in_short(
    rows: Sequence[RunRow], mechanisms: Sequence[MechanismRun], physical: Sequence[RunRow]
) -> list[str]:
    """The findings that a reader should take away."""
    first, *_ = told_table_one(rows)
    lines = [f"The paper's table: {first[0].lower()}{first[1:]}"]
    if is_reach(mechanisms):
        lines.append(
            "Its gap between rectangle and map is a gap in reach: an object counts 12 m ahead in the one and "
            "22.2 m ahead in the other. Given the authors' own 30 m, the rectangle avoids the collision as "
            "well."
        )
    lines.append(f"The paper's test with a real car: {' '.join(told_physical(physical)[:2])}")
    return lines


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
    before, after = impacts(alone), impacts(others)
    if all(abs(after[key] - before[key]) <= 0.05 for key in after):
        lines.append(
            "The paper says that the rectangle suffers when others are around. Static others change none of "
            "its impact speeds here: none is on a collision course, and both strategies share one forecast."
        )
    phases = [
        run for run in mechanisms if run.strategy == "map" and not run.settings and run.v_test_kmh == 70.0
    ]
    touched = [run.v_impact_kmh for run in phases if run.v_impact_kmh > 0.0]
    if touched:
        lines.append(
            f"The paper's map avoids the collision up to 70 km/h. Here that depends on the frames' phase: "
            f"contact in {len(touched)} of {len(phases)} runs, at up to {max(touched):.1f} km/h."
        )
    scores = {name: score_text(physical, name) for name in ("rectangular", "map")}
    if scores["rectangular"] == scores["map"]:
        lines.append(
            f"The paper's map scores more than its rectangle. With a real car and the authors' own clamps "
            f"both score {scores['map']}."
        )
    return lines
