"""SUMO networks, made by its netconvert."""

import shutil
import subprocess
from collections import Counter
from importlib.util import find_spec
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory

from lxml import etree

import _smartmot
from opendrive.errors import OpenDriveError
from opendrive.formats.contents import Export
from opendrive.formats.sumo_plain import METRE_DECIMALS, plain_network
from opendrive.geo import projection_text
from opendrive.network import RoadNetwork

_TIMEOUT_S = 600.0

OPTIONS = (
    "--no-turnarounds",
    "--offset.disable-normalization",
    "--geometry.min-dist=-1",
    "--no-internal-links=false",
    f"--precision={METRE_DECIMALS}",
)
"""Options of netconvert: coordinates stay those of the map frame, and points where they are."""


def write_sumo(network: RoadNetwork, path: str | PathLike[str]) -> Export:
    """Write the traffic lanes of a network as a SUMO network, by netconvert of eclipse-sumo.

    Args:
        network: the map.
        path: file to write, ``.net.xml``.

    Raises:
        OpenDriveError: netconvert is not installed, or refuses the network.
        OSError: the file cannot be written.
    """
    netconvert = find_netconvert()
    plain = plain_network(network)
    if not plain.counts["edges"]:
        raise OpenDriveError("the map has no lane with traffic outside junctions: there is nothing for SUMO")
    with TemporaryDirectory() as folder:
        files = {"node": plain.nodes, "edge": plain.edges, "connection": plain.connections}
        arguments = [str(netconvert), *OPTIONS]
        for kind, content in files.items():
            file = Path(folder) / f"plain.{kind}.xml"
            file.write_bytes(content)
            arguments.append(f"--{kind}-files={file}")
        made = Path(folder) / "made.net.xml"
        arguments.append(f"--output-file={made}")
        if plain.is_left_hand:
            arguments.append("--lefthand")
        try:
            done = subprocess.run(arguments, capture_output=True, text=True, check=False, timeout=_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            raise OpenDriveError(f"netconvert: not ready after {_TIMEOUT_S:g} s; write fewer roads") from None
        if done.returncode or not made.is_file():
            lines = [line for line in done.stderr.splitlines() if line.startswith("Error")]
            raise OpenDriveError(f"netconvert: {lines[0] if lines else 'ended without a network'}")
        notes = _said(done.stderr)
        root = etree.parse(made).getroot()
    _georeferenced(network, root, notes)
    Path(path).write_bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8"))
    return Export(plain.counts, plain.left_out, tuple(notes))


def find_netconvert() -> Path:
    """Return netconvert: that of the package eclipse-sumo, else the one on the path.

    Raises:
        OpenDriveError: there is none.
    """
    package = find_spec("sumo")
    for folder in (package.submodule_search_locations or []) if package is not None else []:
        for name in ("netconvert", "netconvert.exe"):
            if (file := Path(folder) / "bin" / name).is_file():
                return file
    file_name = shutil.which("netconvert")
    if file_name is None:
        raise OpenDriveError(_smartmot.missing_extra("SUMO networks", "sumo", "no netconvert"))
    return Path(file_name)


def _said(output: str) -> list[str]:
    """Return how often netconvert warned of what."""
    kinds: Counter[str] = Counter()
    for line in output.splitlines():
        if line.startswith("Warning: "):
            text = "'...'".join(line.removeprefix("Warning: ").split("'")[::2])
            kinds[text] += 1
    return [f"netconvert: {count} x {text}" for text, count in kinds.items()]


def _georeferenced(network: RoadNetwork, root: etree._Element, notes: list[str]) -> None:
    """Write the map's geoReference into a network: its coordinates are projected ones plus the netOffset."""
    header = network.model.header
    location = root.find("location")
    if location is None or not header.geo_reference.strip():
        return
    offset = header.offset
    if offset is not None and offset.heading_rad:
        notes.append("no geoReference: SUMO has no rotation between map frame and projection")
        return
    x_m, y_m = (0.0, 0.0) if offset is None else (offset.x_m, offset.y_m)
    location.set("netOffset", f"{-x_m + 0.0:.{METRE_DECIMALS}f},{-y_m + 0.0:.{METRE_DECIMALS}f}")
    location.set("projParameter", projection_text(header.geo_reference))
