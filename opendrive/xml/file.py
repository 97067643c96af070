"""What stands in a file: its header, and the tables of everything else."""

from functools import partial
from typing import Any

from lxml import etree

from opendrive.errors import MapContentError, WarningKind
from opendrive.model import GeoOffset, Header
from opendrive.xml.fields import child, number, text
from opendrive.xml.junctions import JUNCTION, JUNCTION_GROUP
from opendrive.xml.roads import ROAD, STATION
from opendrive.xml.signals import CONTROLLER
from opendrive.xml.tables import REST, Field, Table
from opendrive.xml.values import Element, Values, first


def _read_geo_reference(values: Values, element: Element) -> str:
    geo = first(element, "geoReference")
    return "" if geo is None else (geo.text or "").strip()


def _write_geo_reference(element: Element, geo_reference: str) -> None:
    if geo_reference:
        etree.SubElement(element, "geoReference").text = geo_reference


NEWEST = (1, 8)
"""The newest revision of the standard that is read."""


VERSION_RULE = "asam.net:xodr:1.0.0:xml.version_is_defined"


def _revision(values: Values, element: Element, name: str, text: str, least: int, default: int) -> int:
    try:
        revision = values.to_integer(element, name, text)
    except MapContentError:
        message = f"{name} is {text!r:.40}, expected an integer; read as {default}"
        values.warn(WarningKind.REVISION, element, message, rule=VERSION_RULE)
        return default
    if revision < least:
        message = f"{name} {revision} is unknown; read as {default}"
        values.warn(WarningKind.REVISION, element, message)
        return default
    return revision


def _check_revision(values: Values, element: Element, header: Header) -> None:
    revision = (header.rev_major, header.rev_minor)
    written = "{}.{}".format(*revision)
    newest = "{}.{}".format(*NEWEST)
    if revision > NEWEST:
        message = f"revision {written} is newer than what is read ({newest}); what is new in it is not read"
        values.warn(WarningKind.REVISION, element, message)
    for name in ("revMajor", "revMinor"):
        if name not in element.attrib:
            message = f"{name} is missing; the revision is read as {written}"
            values.warn(WarningKind.REVISION, element, message, rule=VERSION_RULE)


_OFFSET = Table(
    GeoOffset,
    x_m=number("x", 0.0).lenient(),
    y_m=number("y", 0.0).lenient(),
    z_m=number("z", 0.0).lenient(),
    heading_rad=number("hdg", 0.0).lenient(),
)

HEADER = Table(
    Header,
    check=_check_revision,
    # There is no revision 0.
    rev_major=number("revMajor", 1, convert=partial(_revision, least=1, default=1)),
    rev_minor=number("revMinor", 4, convert=partial(_revision, least=0, default=4)),
    name=text("name"),
    version=text("version"),
    date=text("date"),
    vendor=text("vendor"),
    north_m=number("north", None).lenient(),
    south_m=number("south", None).lenient(),
    east_m=number("east", None).lenient(),
    west_m=number("west", None).lenient(),
    geo_reference=Field(_read_geo_reference, _write_geo_reference, tags=("geoReference",)),
    offset=child("offset", _OFFSET),
    extra=REST,
)

CONTENT: dict[str, tuple[str, Table[Any]]] = {
    "road": ("roads", ROAD),
    "controller": ("controllers", CONTROLLER),
    "junction": ("junctions", JUNCTION),
    "junctionGroup": ("junction_groups", JUNCTION_GROUP),
    "station": ("stations", STATION),
}
"""By the name of the element, in the order in which they are written: field of `MapModel` and table."""
