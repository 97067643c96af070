"""The roads of a file as records that are made when they are asked for."""

from collections.abc import Callable, Iterable, Iterator, Mapping

from lxml import etree

from opendrive.model import Deferred, Road, RoadDetails
from opendrive.roads.geometry import NetworkGeometry

_FURNITURE = ("signals", "objects", "railroad")


class RoadRecords(Mapping[str, Road]):
    """Roads of a file by id, each read when first asked for.

    Attributes:
        geometry: geometry of all of them.
    """

    def __init__(
        self,
        elements: Mapping[str, etree._Element],
        read: Callable[[etree._Element], Road],
        read_details: Callable[[etree._Element], Deferred[RoadDetails]],
        geometry: NetworkGeometry,
        records: Iterable[Road],
    ) -> None:
        """Defer the reading of `elements`, but for the `records` that are there already."""
        self.geometry = geometry
        self._elements = elements
        self._read = read
        self._read_details = read_details
        self._records = {record.id: record for record in records}

    def __getitem__(self, road_id: str) -> Road:
        record = self._records.get(road_id)
        if record is None:
            record = self._records[road_id] = self._read(self._elements[road_id])
        return record

    def details(self) -> Iterator[tuple[str, RoadDetails]]:
        """Yield id and details of every road that has any signal, object, structure or switch."""
        for road_id, element in self._elements.items():
            if any(len(child) and child.tag in _FURNITURE for child in element):
                yield road_id, self._read_details(element)()

    def with_part(self, tag: str) -> Iterator[Road]:
        """Yield the roads in which there are elements of a name."""
        for road_id, element in self._elements.items():
            if next(element.iter(tag), None) is not None:
                yield self[road_id]

    def __contains__(self, road_id: object) -> bool:
        return road_id in self._elements

    def __iter__(self) -> Iterator[str]:
        return iter(self._elements)

    def __len__(self) -> int:
        return len(self._elements)
