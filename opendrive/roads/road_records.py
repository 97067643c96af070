"""The roads of a file as records that are made when they are asked for."""

from collections.abc import Callable, Iterator, Mapping

from lxml import etree

from opendrive.model import Road
from opendrive.roads.geometry import NetworkGeometry


class RoadRecords(Mapping[str, Road]):
    """Roads of a file by id, each read when first asked for.

    Attributes:
        geometry: geometry of all of them, read without the records; None where that was not possible.
    """

    def __init__(
        self,
        elements: Mapping[str, etree._Element],
        read: Callable[[etree._Element], Road],
        geometry: NetworkGeometry | None,
    ) -> None:
        """Defer the reading of `elements`."""
        self.geometry = geometry
        self._elements = elements
        self._read = read
        self._records: dict[str, Road] = {}

    def __getitem__(self, road_id: str) -> Road:
        record = self._records.get(road_id)
        if record is None:
            record = self._records[road_id] = self._read(self._elements[road_id])
        return record

    def __contains__(self, road_id: object) -> bool:
        return road_id in self._elements

    def __iter__(self) -> Iterator[str]:
        return iter(self._elements)

    def __len__(self) -> int:
        return len(self._elements)
