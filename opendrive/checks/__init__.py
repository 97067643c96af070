"""What is wrong with a map: defects that are tolerated, across links too, and rules of the standard."""

from opendrive.checks.contents import content_warnings
from opendrive.checks.curves import curve_warnings, refuse_impossible_lanes
from opendrive.checks.findings import findings_json, findings_xqar, refuse_warnings, warning_table
from opendrive.checks.joints import Joints
from opendrive.checks.links import link_warnings
from opendrive.checks.profiles import profile_warnings
from opendrive.checks.rules import rule_warnings

__all__ = [
    "Joints",
    "content_warnings",
    "curve_warnings",
    "findings_json",
    "findings_xqar",
    "link_warnings",
    "profile_warnings",
    "refuse_impossible_lanes",
    "refuse_warnings",
    "rule_warnings",
    "warning_table",
]
