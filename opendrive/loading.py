"""Files to road networks."""

from os import PathLike
from pathlib import Path

from opendrive.checks import refuse_warnings
from opendrive.errors import MapContentError
from opendrive.network import RoadNetwork
from opendrive.xml.layers import PERMANENT
from opendrive.xml.reader import read_map


def load_map(path: str | PathLike[str], *, strict: bool = False, layer: str = PERMANENT) -> RoadNetwork:
    """Load an OpenDRIVE map.

    Args:
        path: the ``.xodr`` file (ASAM OpenDRIVE 1.4 to 1.8, and lane layers of 1.9).
        strict: refuse the defects that are otherwise tolerated and listed in `RoadNetwork.warnings`.

        layer: lane layer to read, where a road has lanes of it: ``permanent`` or ``temporary``.

    Raises:
        MapReadError: the file does not exist, cannot be opened, is not well-formed XML or is not OpenDRIVE.
        MapContentError: a required element or attribute is missing, or has an impossible value; with
            `strict`, also any defect that would be a warning.
    """
    model = read_map(path, layer)
    try:
        network = RoadNetwork(model)
        if strict:
            refuse_warnings(network.warnings)
    except MapContentError as error:
        raise MapContentError(f"{Path(path)}: {error}", error.rule) from None
    return network
