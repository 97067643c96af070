"""The bytes of what is published are those of rosbags' own writer, in every byte."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scenarios.live.counts import Diagnostics
from scenarios.live.outputs import Decision, FrameOutput, Marker, TrackedBoxes
from scenarios.live.perception import Output
from scenarios.live.published import published
from scenarios.live.settings import LiveSettings
from scenarios.ros.definitions import ros2_types
from scenarios.ros.making import rosbags_make
from smartmot.types import CATEGORIES
from tests.scenarios.live.published_objects import MessageObjects
from tests.scenarios.live.streams_made import Row, outputs_of, straight

TYPES = ros2_types()
OBJECTS = MessageObjects(rosbags_make(TYPES))

# of any length modulo 8, and longer in bytes than in characters
texts = st.text(st.characters(codec="utf-8"), max_size=12)
numbers = st.floats(width=64)
small = st.floats(width=32)
points = st.tuples(numbers, numbers, numbers)
stamps = st.integers(0, 2**31 * 1_000_000_000 - 1)
markers = st.lists(
    st.builds(
        Marker,
        ns=texts,
        marker_id=st.integers(0, 2**40),
        kind=st.sampled_from((0, 1, 4, 9)),
        action=st.sampled_from((0, 2)),
        position_m=points,
        yaw_rad=st.floats(-4.0, 4.0),
        scale_m=points,
        colour=st.tuples(small, small, small, small),
        points_m=st.lists(points, max_size=3).map(tuple),
        text=texts,
        lifetime_s=st.floats(0.0, 10.0),
    ),
    max_size=4,
).map(tuple)


@st.composite
def tracked(draw: st.DrawFn) -> TrackedBoxes:
    count = draw(st.integers(0, 4))

    def column(width: int | None = None) -> st.SearchStrategy[np.ndarray]:
        return arrays(np.float64, (count,) if width is None else (count, width), elements=numbers)

    return TrackedBoxes(
        np.array(draw(st.lists(st.integers(0, 2**40), min_size=count, max_size=count)), dtype=np.int64),
        np.array(draw(st.lists(st.sampled_from(CATEGORIES), min_size=count, max_size=count)), dtype=np.str_),
        draw(column()),
        draw(column(3)),
        draw(column(3)),
        draw(arrays(np.float64, (count,), elements=st.floats(-4.0, 4.0))),
        draw(column(2)),
        np.zeros(count, dtype=np.bool_),
    )


decisions = st.builds(Decision, st.booleans(), st.none() | numbers, st.just(()), st.just(()))
frames = st.builds(FrameOutput, stamps, stamps, texts, tracked(), markers, st.none() | decisions, markers)
statuses = st.builds(
    Diagnostics,
    stamps,
    st.sampled_from((0, 1, 2)),
    texts,
    st.lists(st.tuples(texts, texts), max_size=3).map(tuple),
)


def by_rosbags(output: Output) -> list[tuple[str, bytes]]:
    return [
        (topic.name, bytes(TYPES.serialize_cdr(message, topic.type_name)))
        for topic, message in OBJECTS.messages(output)
    ]


@given(frames | statuses)
def test_bytes_are_those_of_rosbags(output: Output) -> None:
    assert [(topic.name, data) for topic, data in published(output)] == by_rosbags(output)


@pytest.mark.parametrize("strategy", ["rectangular", "path", "all"])
def test_bytes_of_a_drive_are_those_of_rosbags(strategy: str) -> None:
    def objects(time_s: float) -> list[Row]:
        return [
            ("car", 40.0, 0.0, 0.0, 4.5, 1.8, 0.9),
            ("pedestrian", 30.0, -6.0 + 1.4 * time_s, 1.5, 0.5, 0.5, 0.8),
        ]

    outputs, _ = outputs_of(straight(40, objects), LiveSettings(preset="physical", strategy=strategy))
    assert len(outputs) > 40
    for output in outputs:
        assert [(topic.name, data) for topic, data in published(output)] == by_rosbags(output)
