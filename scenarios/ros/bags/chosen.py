"""Which topics of a bag are read: known by their types, named where there are several."""

from __future__ import annotations

from dataclasses import dataclass

from scenarios.errors import DatasetError
from scenarios.ros.bags.bag import Bag
from scenarios.ros.definitions import ODOMETRY, OLD_TRANSFORMS, TRANSFORMS
from scenarios.ros.messages import DETECTION_TYPES

_SHOWN_TOPICS = 5


@dataclass(frozen=True, slots=True)
class ChosenTopics:
    """Names of the topics that perception reads.

    Args:
        boxes: of the detections.
        odometry: of the poses; None: there is none.
        transforms: of the transforms, also of ROS 1.
    """

    boxes: str
    odometry: str | None
    transforms: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """All of them."""
        return (self.boxes, *([] if self.odometry is None else [self.odometry]), *self.transforms)


def chosen_topics(bag: Bag, boxes: str | None, odometry: str | None) -> ChosenTopics:
    """The topics that are read of a bag.

    Args:
        bag: the bag.
        boxes: topic of the boxes (`--topic`); None: the only one of their types.
        odometry: topic of the poses (`--odometry`); None: the only one of its type, if there is one.

    Raises:
        DatasetError: there is no topic of boxes, several with messages of which none is named, or none of the
            name, or one with two types; the message names bag, topics and option.
    """
    chosen = _chosen(bag, boxes, DETECTION_TYPES, "boxes", "--topic")
    if chosen is None:
        listed = _listed({topic.name: topic.type_name for topic in bag.topics}) or "no topics"
        raise DatasetError(f"{bag.path}: no topic of {' or '.join(DETECTION_TYPES)}; it has {listed}")
    poses = _chosen(bag, odometry, (ODOMETRY,), "odometry", "--odometry")
    transforms = {topic.name for topic in bag.of_type(TRANSFORMS, OLD_TRANSFORMS)}
    topics = ChosenTopics(chosen, poses, tuple(sorted(transforms)))
    bag.require_one_type(*topics.names)
    return topics


def _chosen(bag: Bag, name: str | None, types: tuple[str, ...], noun: str, option: str) -> str | None:
    """Name of the topic with some types; None: there is none."""
    candidates = {topic.name: topic.type_name for topic in bag.of_type(*types)}
    if name is not None:
        if name not in candidates:
            others = ", ".join(candidates) or "none"
            raise DatasetError(f"{bag.path}: {option} {name}: not a topic with {noun}; there are: {others}")
        return name
    filled = {topic: kind for topic, kind in candidates.items() if bag.count(topic) != 0}
    if len(filled) > 1:
        listed = ", ".join(f"{topic} ({kind})" for topic, kind in filled.items())
        raise DatasetError(f"{bag.path}: several topics with {noun}: {listed}; name one with {option}")
    return next(iter(filled or candidates), None)


def _listed(types: dict[str, str]) -> str:
    """Some topics with their types."""
    shown = ", ".join(f"{name} ({kind})" for name, kind in list(types.items())[:_SHOWN_TOPICS])
    more = len(types) - _SHOWN_TOPICS
    return f"{shown} and {more} more" if more > 0 else shown
