"""Which topics of a bag are read: known by their types, named where there are several."""

from __future__ import annotations

from collections.abc import Mapping
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
        boxes: of the detections, one or several.
        odometry: of the poses; None: there is none.
        transforms: of the transforms, also of ROS 1.
    """

    boxes: tuple[str, ...]
    odometry: str | None
    transforms: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """All of them."""
        return (*self.boxes, *([] if self.odometry is None else [self.odometry]), *self.transforms)


def chosen_topics(
    bag: Bag, boxes: str | None, odometry: str | None, several: Mapping[str, str] | None = None
) -> ChosenTopics:
    """The topics that are read of a bag.

    Args:
        bag: the bag.
        boxes: topic of the boxes (`--topic`); None: the only one of their types.
        odometry: topic of the poses (`--odometry`); None: the only one of its type, if there is one.
        several: topics of the boxes of several detectors (`--detectors`), with their types; None: there is
            one.

    Raises:
        DatasetError: there is no topic of boxes, several with messages of which none is named, or none of the
            name, or one with two types; the message names bag, topics and option.
    """
    if several:
        chosen = _of_detectors(bag, several)
    else:
        only = _chosen(bag, boxes, DETECTION_TYPES, "boxes", "--topic")
        if only is None:
            listed = _listed({topic.name: topic.type_name for topic in bag.topics}) or "no topics"
            raise DatasetError(f"{bag.path}: no topic of {' or '.join(DETECTION_TYPES)}; it has {listed}")
        chosen = (only,)
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


def _of_detectors(bag: Bag, several: Mapping[str, str]) -> tuple[str, ...]:
    """Topics of several detectors, each with the type that the user says."""
    there = {topic.name: topic.type_name for topic in bag.of_type(*DETECTION_TYPES)}
    for name, kind in several.items():
        if name not in there:
            others = ", ".join(there) or "none"
            raise DatasetError(f"{bag.path}: --detectors: {name} is no topic with boxes; there are: {others}")
        if there[name] != kind:
            raise DatasetError(
                f"{bag.path}: --detectors: {name} is of type {there[name]}, and the file says {kind}; say it "
                f'with type = "{there[name]}"'
            )
    return tuple(several)


def _listed(types: dict[str, str]) -> str:
    """Some topics with their types."""
    shown = ", ".join(f"{name} ({kind})" for name, kind in list(types.items())[:_SHOWN_TOPICS])
    more = len(types) - _SHOWN_TOPICS
    return f"{shown} and {more} more" if more > 0 else shown
