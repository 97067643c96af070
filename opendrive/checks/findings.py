"""Findings as text, JSON, and the result file of ASAM's quality checkers."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from typing import Any

from lxml import etree

from opendrive.errors import MapContentError, MapWarning

CHECKER = "smartmot_opendrive"

Place = tuple[float, float, float]


def refuse_warnings(warnings: Sequence[MapWarning]) -> None:
    """Refuse a map that has any defect.

    Raises:
        MapContentError: there is one; the first one and their number are named.
    """
    defects = [warning for warning in warnings if warning.kind.is_defect]
    if defects:
        first = defects[0]
        more = f" (and {len(defects) - 1} more)" if len(defects) > 1 else ""
        where = f"road {first.road_id!r}, " if first.road_id else ""
        raise MapContentError(
            f"{where}<{first.element}>: {first.kind}: {first.message}{more}; load without strict to tolerate"
        )


def warning_table(warnings: Sequence[MapWarning]) -> list[str]:
    """Return the lines of a table of warnings, with their number at the end."""
    rows = [("kind", "road", "lane", "s", "element", "what")] if warnings else []
    rows += [
        (
            w.kind.value,
            w.road_id or "-",
            "-" if w.lane_id is None else str(w.lane_id),
            "-" if w.s_m is None else f"{w.s_m:.2f}",
            w.element,
            w.message + (f" [{w.rule}]" if w.rule else ""),
        )
        for w in warnings
    ]
    widths = [max(len(row[k]) for row in rows) for k in range(5)] if rows else []
    lines = [
        "  ".join([*(cell.ljust(n) for cell, n in zip(row, widths, strict=False)), row[5]]) for row in rows
    ]
    broken = sum(not warning.kind.is_defect for warning in warnings)
    total = f"{len(warnings) - broken} defects"
    return [*lines, f"{total}, {broken} broken rules of the standard" if broken else total]


def findings_json(file: str, warnings: Iterable[MapWarning]) -> str:
    """Return findings as JSON: kind, road, lane, s, amount, unit, rule, element and message of each."""
    findings = [
        {
            "kind": w.kind.value,
            "road": w.road_id or None,
            "lane": w.lane_id,
            "s_m": w.s_m,
            "amount": w.amount,
            "unit": w.unit or None,
            "rule": w.rule or None,
            "element": w.element,
            "message": w.message,
        }
        for w in warnings
    ]
    return json.dumps({"file": file, "findings": findings}, indent=1, allow_nan=False) + "\n"


def findings_xqar(
    file: str, version: str, warnings: Sequence[MapWarning], place: Callable[[MapWarning], Place | None]
) -> bytes:
    """Return findings as the result file (``.xqar``) of ASAM's quality checker framework, version 1.0.

    Args:
        file: the map.
        version: version of the program.
        warnings: the findings.
        place: gives x, y, z of a finding in the map frame, or None.
    """
    root = etree.Element("CheckerResults", version="1.0.0")
    bundle = etree.SubElement(
        root,
        "CheckerBundle",
        name=CHECKER,
        version=version,
        build_date="",
        description="OpenDRIVE maps: links, profiles, contents and rules",
        summary=f"{len(warnings)} findings",
    )
    etree.SubElement(bundle, "Param", name="InputFile", value=file)
    number = 0
    for kind in dict.fromkeys(warning.kind for warning in warnings):
        of_kind = [warning for warning in warnings if warning.kind is kind]
        name = kind.value.replace(" ", "_").replace("-", "_")
        checker = etree.SubElement(
            bundle,
            "Checker",
            status="completed",
            checkerId=f"check_{name}",
            description=kind.value,
            summary=f"{len(of_kind)} issue(s) are found.",
        )
        for rule in dict.fromkeys(_rule(warning) for warning in of_kind):
            etree.SubElement(checker, "AddressedRule", ruleUID=rule)
        for warning in of_kind:
            _add_issue(checker, number, warning, place(warning))
            number += 1
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def _rule(warning: MapWarning) -> str:
    """Return the rule of a finding; those without one in the standard get a name of this package's own."""
    own = warning.kind.value.replace(" ", "_").replace("-", "_")
    return warning.rule or f"smartmot:xodr:1.0.0:{own}"


def _add_issue(checker: Any, number: int, warning: MapWarning, at: Place | None) -> None:
    where = [f"road {warning.road_id}"] if warning.road_id else []
    where += [] if warning.lane_id is None else [f"lane {warning.lane_id}"]
    where += [] if warning.s_m is None else [f"s = {warning.s_m:.6g} m"]
    issue = etree.SubElement(
        checker,
        "Issue",
        issueId=str(number),
        description=", ".join([*where, warning.element]) + f": {warning.message}",
        level="1" if warning.kind.is_defect else "2",
        ruleUID=_rule(warning),
    )
    if at is not None:
        locations = etree.SubElement(issue, "Locations", description=", ".join(where))
        x, y, z = map(repr, at)
        etree.SubElement(locations, "InertialLocation", x=x, y=y, z=z)
