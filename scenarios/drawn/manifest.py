"""Tables beside drawn scenes: what was drawn for each, and how many draws were rejected for which reason."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from scenarios.drawn.actors import Actor
from scenarios.drawn.avoidance import Avoidance
from scenarios.drawn.proof import Proof
from scenarios.drawn.situations.situation import Situation
from scenarios.drawn.stage import Stage
from scenarios.scenes.scenes import SceneRun

MANIFEST, REJECTED = "manifest.csv", "rejected.csv"
GIVEN_UP = "given up: no map has room for it"


@dataclass(frozen=True, slots=True)
class DrawnScene:
    """A scene that was drawn, and what its proof has shown.

    Args:
        run: as the comparison runs it.
        situation: what it is about.
        stage: where.
        actors: all but the ego.
        values: what was drawn, by name.
        proof: its unbraked run.
        avoidance: what is left to do in a must-brake scene; None: nothing has to be done.
        rejected: draws before it that were rejected, by reason.
    """

    run: SceneRun
    situation: Situation
    stage: Stage
    actors: tuple[Actor, ...]
    values: dict[str, float | str]
    proof: Proof
    avoidance: Avoidance | None = None
    rejected: Counter[tuple[str, str]] = field(default_factory=Counter)


def write_manifest(path: Path, scenes: Sequence[DrawnScene]) -> None:
    """One row for each scene: what it is, where, how its proof ended, and all that was drawn."""
    drawn = sorted({name for scene in scenes for name in scene.values})
    fixed = (
        "scene", "must", "situation", "map", "road", "lane", "s_m", "place", "speed_kmh", "contact_s",
        "notice_s", "avoidable", "gap_m", "starts_aside_m", "road_users", "rejected_before",
    )  # fmt: skip
    rows = [[*fixed, *drawn]]
    for scene in scenes:
        stage, proof = scene.stage, scene.proof
        road, lane, s_m = stage.place_at(stage.line_m)
        contact = f"{proof.contact_s:.3f}" if proof.entity else ""
        gap = "" if proof.entity else f"{proof.gap_m:.3f}"
        left = scene.avoidance
        notice = (f"{left.notice_s:.3f}", "yes" if left.avoidable else "no") if left else ("", "")
        start = scene.actors[0].start
        aside = abs(stage.route.project(start.x_m, start.y_m)[1])
        values = [_cell(scene.values.get(name, "")) for name in drawn]
        rows.append(
            [
                scene.run.scene, scene.run.must, scene.situation.name, stage.ground.name, road, str(lane),
                f"{s_m:.3f}", stage.kind, f"{scene.run.speed_kmh:g}", contact, *notice, gap, f"{aside:.2f}",
                str(len(scene.actors)), str(sum(scene.rejected.values())), *values,
            ]
        )  # fmt: skip
    _write_rows(path, rows)


def _cell(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def write_rejected(path: Path, scenes: Sequence[DrawnScene]) -> None:
    """How many draws were rejected, by kind, situation and reason."""
    counts: Counter[tuple[str, str, str]] = Counter()
    for scene in scenes:
        for (situation, reason), number in scene.rejected.items():
            counts[(scene.run.must, situation, reason)] += number
    rows = [["must", "situation", "reason", "draws"]]
    rows += [[*key, str(number)] for key, number in sorted(counts.items())]
    _write_rows(path, rows)


def _write_rows(path: Path, rows: list[list[str]]) -> None:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    path.write_text(text.getvalue(), encoding="utf-8", newline="\n")


def draw_notes(folder: Path, count: int) -> list[str]:
    """How many draws were rejected, and which situations no map had room for: a line each.

    Args:
        folder: of the scenes.
        count: how many there are.
    """
    with (folder / REJECTED).open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    given_up = {row["situation"]: int(row["draws"]) for row in rows if row["reason"] == GIVEN_UP}
    rejected = sum(int(row["draws"]) for row in rows) - sum(given_up.values())
    lines = [f"{count} scenes drawn, {rejected} draws rejected; the reasons: {folder / REJECTED}"]
    return lines + [
        f"no map has room for '{name}', drawn {number} times; other situations in its place"
        for name, number in given_up.items()
    ]
