"""Records to OpenDRIVE XML: what is read again equals what was written."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Protocol

from lxml import etree

from opendrive.errors import OpenDriveError
from opendrive.model import MapModel
from opendrive.xml.file import CONTENT, HEADER
from opendrive.xml.tables import REST


class HasModel(Protocol):
    """A network that was made from a map."""

    @property
    def model(self) -> MapModel:
        """The map as read."""


def write_map(source: MapModel | HasModel, path: str | PathLike[str]) -> None:
    """Write a map as an OpenDRIVE file; speeds are written in m/s.

    Args:
        source: a network, or its model.
        path: file to write.

    Raises:
        OpenDriveError: the file cannot be written.
    """
    data = map_bytes(source if isinstance(source, MapModel) else source.model)
    try:
        Path(path).write_bytes(data)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OpenDriveError(f"{path}: cannot be written ({reason})") from error


def map_bytes(model: MapModel) -> bytes:
    """Return what `write_map` writes."""
    root = etree.Element("OpenDRIVE")
    HEADER.write(etree.SubElement(root, "header"), model.header)
    for tag, (name, table) in CONTENT.items():
        records = getattr(model, name)
        for record in records.values() if isinstance(records, Mapping) else records:
            table.write(etree.SubElement(root, tag), record)
    REST.write(root, model.extra)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
