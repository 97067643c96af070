"""Catalog entries, found by catalog and entry name in the directories that a scenario lists."""

from __future__ import annotations

import re
from pathlib import Path

from lxml import etree

from scenarios.openscenario.errors import CatalogError, ContentError, ParameterError
from scenarios.openscenario.reading.document import Element, Node, Scope, parse
from scenarios.openscenario.reading.parameters import Declarations

PARAMETER = re.compile(r"\$([A-Za-z_]\w*)")
"""A reference to a parameter in a value or an expression."""

LOCATIONS = {
    "VehicleCatalog": "Vehicle",
    "PedestrianCatalog": "Pedestrian",
    "MiscObjectCatalog": "MiscObject",
    "EnvironmentCatalog": "Environment",
    "ManeuverCatalog": "Maneuver",
    "TrajectoryCatalog": "Trajectory",
    "RouteCatalog": "Route",
    "ControllerCatalog": "Controller",
}
"""Element of CatalogLocations: what its entries are."""


class Catalogs:
    """Catalogs of one scenario.

    Args:
        node: its CatalogLocations element, or None.
    """

    def __init__(self, node: Node | None) -> None:
        self.files: list[Path] = []
        """Every file of the directories, in the order in which they were read."""
        self._entries: dict[tuple[str, str], tuple[Path, Element]] = {}
        self._stems: dict[str, str] = {}
        self._names: list[str] = []
        self._missing: list[str] = []
        self.notes: dict[str, None] = {}
        """Lines about what is not there and not needed, or there twice."""
        if node is None:
            return
        node.allow(children=" ".join(LOCATIONS))
        for location in node:
            location.allow(children="Directory")
            directory = location.need("Directory")
            directory.allow("path")
            self._load(directory)

    def _load(self, node: Node) -> None:
        directory = node.path("path")
        is_file = directory.is_file()  # openPASS names the file of a catalog
        if not is_file and not directory.is_dir():
            self._missing.append(f"{node.where} catalog directory {directory} does not exist")
            return
        for file in [directory] if is_file else sorted(directory.glob("*.xosc")):
            if file in self.files:
                continue
            self.files.append(file)
            for catalog in parse(file).iterchildren("Catalog"):
                name = catalog.get("name", "")
                self._names.append(name)
                self._stems.setdefault(file.stem, name)
                for entry in catalog:
                    self._entries.setdefault((name, entry.get("name", "")), (file, entry))

    def note_missing(self) -> None:
        """Take note of directories that are missing, once nothing has asked for them."""
        self.notes |= {f"{line}; nothing needs it": None for line in self._missing}

    def entry(self, reference: Node, tags: str) -> Node:
        """The entry that a CatalogReference element names, seeing its own parameters.

        Args:
            reference: the CatalogReference.
            tags: what the entry may be (names separated by blanks).

        Raises:
            CatalogError: no such catalog or entry, or it is something else.
            ParameterError: a parameter assignment does not fit.
        """
        reference.allow("catalogName entryName", "ParameterAssignments")
        name, entry_name = reference.text("catalogName"), reference.text("entryName")
        if name not in self._names and name in self._stems:  # esmini looks for a file of that name
            self.notes[
                f"{reference.where} takes '{name}' for the file of that name: its catalog is called "
                f"'{self._stems[name]}'"
            ] = None
            name = self._stems[name]
        located = self._entries.get((name, entry_name))
        if located is None:
            if name not in self._names:
                listed = ", ".join(sorted(set(self._names))) or "none"
                missing = "".join(f"; {line}" for line in self._missing)
                raise CatalogError(
                    f"{reference.where} no catalog '{name}'; catalogs found: {listed}{missing}"
                )
            entries = ", ".join(sorted(e for c, e in self._entries if c == name))
            raise CatalogError(
                f"{reference.where} no entry '{entry_name}' in catalog '{name}'; entries there: {entries}"
            )
        file, element = located
        if element.tag not in tags.split():
            wanted = " or ".join(f"<{tag}>" for tag in tags.split())
            raise CatalogError(f"{reference.where} '{entry_name}' is a <{element.tag}>, expected a {wanted}")
        node = Node(element, file, {})
        given = assignments(reference.get("ParameterAssignments"))
        try:
            outer = self._lent(node, reference)
            scope = Declarations(
                node.get("ParameterDeclarations"), given, outer, self.notes, loose=True
            ).scope()
        except ParameterError as error:
            message = str(error)
            if message.startswith("parameter "):
                message = f"{reference.where} {name}/{entry_name}: {message}"
            raise ParameterError(message) from None
        return node.within(scope)

    def _lent(self, node: Node, reference: Node) -> Scope:
        """Parameters of the scenario that an entry refers to and does not declare; as in esmini."""
        declared = {
            child.get("name", "").removeprefix("$") for child in node.element.iter("ParameterDeclaration")
        }
        used = {
            name
            for child in node.element.iter(etree.Element)
            for text in map(str, child.values())
            if text.strip().startswith("$")
            for name in PARAMETER.findall(text)
        }
        lent = {name: reference.scope[name] for name in sorted(used - declared) if name in reference.scope}
        for name in lent:
            self.notes[f"{node.where} does not declare '{name}': it is that of the scenario"] = None
        return lent


def assignments(node: Node | None) -> Scope:
    """Values of a ParameterAssignments element (or of none) by parameter name.

    Raises:
        ContentError: a parameter is assigned twice.
    """
    values: dict[str, str | float | bool] = {}
    if node is None:
        return values
    node.allow(children="ParameterAssignment")
    for child in node:
        child.allow("parameterRef value")
        name = child.name("parameterRef")
        if name in values:
            raise ContentError(f"{child.where} assigns '{name}' a second time")
        values[name] = child.value("value")
    return values
