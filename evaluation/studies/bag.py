"""What perception would have done on a recorded bag: read as a stream, answered as the live node answers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from evaluation.results.gates import Side
from evaluation.results.tables import EMPTY, Table, fixed
from scenarios.errors import DatasetError
from scenarios.live.bag_writer import BagWriter
from scenarios.live.counts import Counts
from scenarios.live.outputs import FrameOutput
from scenarios.live.perception import LivePerception, Output
from scenarios.live.settings import LiveSettings
from scenarios.reading import ReadError
from scenarios.recorded.bags.reader import bag_classes
from scenarios.recorded.classes import most_common
from scenarios.recorded.maps.drive_map import load_drive_map
from scenarios.ros.bags.bag import Bag, open_bag
from scenarios.ros.bags.chosen import chosen_topics
from scenarios.ros.bags.decoding import decoded, require_readable
from scenarios.ros.frames.transforms import is_static
from scenarios.ros.messages import Message
from scenarios.sources.requests import EMERGENCY, Request
from smartmot.maps.follow import MAX_FROM_LANE_M

_SHOWN_NAMES = 5
_TOLD_EVERY = 100
"""Messages between two looks at the progress bar."""


@dataclass(frozen=True, slots=True)
class BagOptions:
    """What is read and written.

    Args:
        path: the bag.
        out: the bag to be written.
        storage: see `BagWriter`.
        topic: of the boxes; None: the only one of their types.
        odometry: topic of the poses; None: the only one of its type, else transforms.
        settings: how it is seen and judged.
        map_file: map in the frame of the odometry.
    """

    path: Path
    out: Path
    storage: str | None = None
    topic: str | None = None
    odometry: str | None = None
    settings: LiveSettings = field(default_factory=LiveSettings)
    map_file: Path | None = None


@dataclass(frozen=True, slots=True)
class BagResult:
    """What came of it.

    Args:
        counts: of frames and boxes.
        strategy: the monitored area.
        start_ns: stamp of the first frame; None: there is none.
        requests: emergency requests and warnings.
        written: messages written.
        notes: what a user should know.
    """

    counts: Counts
    strategy: str
    start_ns: int | None
    requests: tuple[Request, ...]
    written: int
    notes: tuple[str, ...]


def see_bag(options: BagOptions, progress: Callable[[int, int | None], None]) -> BagResult:
    """Read a bag, and write what perception publishes.

    Args:
        options: what and how.
        progress: called with the messages read so far, and their number if the bag says it.

    Raises:
        DatasetError: the bag cannot be read or written, does not hold what is needed, would be written
            into the folder that is read, or is in no frame on the map.
        ScenarioError, smartmot.errors.SmartMotError, opendrive.OpenDriveError: a setting or the map is wrong.
    """
    if options.path.is_dir() and options.path.resolve() in options.out.resolve().parents:
        raise DatasetError(f"{options.out}: lies in the bag that is read; name a place outside of it")
    lane_map = None if options.map_file is None else load_drive_map(options.map_file)
    classes = bag_classes(options.path, {})
    perception = LivePerception(options.settings, lane_map, classes)
    requests: list[Request] = []
    start_ns: int | None = None
    with open_bag(options.path) as bag:
        detectors = {each.topic: each for each in options.settings.detectors}
        several = {topic: each.type_name for topic, each in detectors.items()}
        topics = chosen_topics(bag, options.topic, options.odometry, several)
        names = set(topics.names)
        stream = _Stream(bag, names, progress)
        with BagWriter(options.out, options.storage) as written:
            for output in _answers(
                perception, stream, {topic: each.name for topic, each in detectors.items()}
            ):
                written.write(output)
                if isinstance(output, FrameOutput):
                    start_ns = output.stamp_ns if start_ns is None else start_ns
                    requests += output.decision.requests if output.decision else ()
            if not perception.counts.frames:
                raise DatasetError(f"{options.path}: topic {' and '.join(topics.boxes)} has no messages")
            if perception.counts.nowhere_on_map:
                raise DatasetError(
                    f"{options.map_file}: the vehicle of {options.path} is in no frame within "
                    f"{MAX_FROM_LANE_M:g} m of a driving lane; is the map in the frame of the odometry?"
                )
        notes = [*bag.notes, *_read_notes(bag, names), *perception_notes(perception)]
    return BagResult(
        perception.counts, perception.strategy, start_ns, tuple(requests), written.count, tuple(notes)
    )


def _answers(perception: LivePerception, stream: _Stream, detectors: Mapping[str, str]) -> Iterator[Output]:
    """What is published, in its order; detectors have a name by topic where there are several."""
    for message, topic in stream:
        yield from perception.take(message, is_static(topic), detectors.get(topic, ""))
    yield from perception.finish()


class _Stream:
    """Messages of some topics in the order in which they were received, whatever their order in the files.

    Each comes with the name of its topic.
    """

    def __init__(self, bag: Bag, names: set[str], progress: Callable[[int, int | None], None]) -> None:
        self._bag, self._names, self._progress = bag, names, progress

    def __iter__(self) -> Iterator[tuple[Message, str]]:
        """The messages; `DatasetError` where one cannot be read."""
        try:
            for topic in self._bag.topics:
                if topic.name in self._names:
                    require_readable(topic)
            # stable: of equal times, the order of the files
            messages = sorted(self._bag.raw(self._names), key=lambda message: message.received_ns)
            for number, raw in enumerate(messages):
                yield decoded(raw), raw.topic.name
                if number % _TOLD_EVERY == 0:
                    self._progress(number + 1, len(messages))
        except ReadError as error:
            raise DatasetError(f"{self._bag.path}: {error}") from None


def _read_notes(bag: Bag, names: set[str]) -> list[str]:
    """Which topics were read, and which were not."""
    others = sorted({topic.name for topic in bag.topics} - names)
    notes = [f"read: {', '.join(sorted(names))}"]
    if others:
        more = f" and {len(others) - _SHOWN_NAMES} more" if len(others) > _SHOWN_NAMES else ""
        notes.append(f"not read: {', '.join(others[:_SHOWN_NAMES])}{more}")
    return notes


def perception_notes(perception: LivePerception) -> list[str]:
    """What a user should know of how a stream was seen: what was assumed, and what was left out.

    Of several detectors each has lines of its own.
    """
    several = perception.settings.detectors
    notes = _common_notes(perception)
    for name, counts in perception.counts_of.items():
        whose = f"detector {name}: " if several else ""
        notes += [whose + text for text in _notes_of(perception, name, counts)]
    return notes


def _common_notes(perception: LivePerception) -> list[str]:
    """Of all detectors together."""
    counts, settings, localisation = perception.counts, perception.settings, perception.localisation
    refused = localisation.poses.refused + localisation.tree.refused
    own = "the sensor's frame" if not settings.detectors else f"the frame {localisation.base_frame}"
    lines = (
        (
            counts.without_pose and counts.without_pose == counts.frames,
            f"no pose of the vehicle: tracks are in {own}, and nothing is decided",
        ),
        (counts.restarts, f"times that time went back: {counts.restarts}; all was begun anew"),
        (
            counts.off_map,
            f"frames beside the map's driving lanes: {counts.off_map}; the rectangle is monitored there",
        ),
        (refused, f"poses or transforms that are not finite, repeated or in another frame: {refused}"),
        (
            perception.strategy == "path" and counts.decided,
            "no planned path is among the messages: the arc of the present turn rate stands in for it",
        ),
    )
    return [text for number, text in lines if number]


def _notes_of(perception: LivePerception, name: str, counts: Counts) -> list[str]:
    """Of one detector."""
    settings, localisation = perception.settings, perception.localisation
    detector = next((each for each in settings.detectors if each.name == name), None)
    sensors = ", ".join(
        f"{name or 'a frame without a name'} in {number} frames"
        for name, number in sorted(counts.without_transform.items())
    )
    unknown = most_common(counts.unknown_classes, "without a class")
    wait_ms = settings.wait_s * 1e3
    profile = None if detector is None else detector.profile
    trust = "" if profile is None else f", trust {profile.trust:g}, {profile.delay_s:g} s late by its profile"
    dataset = settings.dataset if detector is None or detector.dataset is None else detector.dataset
    lines = (
        (detector, f"{counts.frames} frames with {counts.boxes} boxes{trust}"),
        (
            counts.unstamped,
            f"frames with an empty header: {counts.unstamped}; the time at which they were received counts",
        ),
        (
            counts.unnamed
            and detector is None
            and (settings.output_frame == "sensor" or counts.decided < counts.tracked),
            f"frames whose header names no sensor: {counts.unnamed}; what is published in the sensor's frame "
            f"is in {localisation.base_frame} for them",
        ),
        (
            sensors,
            f"no transform from {localisation.base_frame} to {sensors}: the sensor is taken to be at the "
            "vehicle's origin; give its place (sensor pose)",
        ),
        (
            counts.without_pose and perception.counts.without_pose < perception.counts.frames,
            f"frames farther than {settings.carry_s:g} s from any pose: {counts.without_pose}; nothing is "
            "decided on them",
        ),
        (
            counts.carried,
            f"frames that waited {wait_ms:g} ms in vain for a pose: {counts.carried}; the last one was "
            "carried on",
        ),
        (
            counts.behind,
            f"frames behind a newer one of another detector: {counts.behind}; taken in at their time",
        ),
        (
            counts.late,
            f"frames not newer than the one before: {counts.late}; they are left out"
            if detector is None
            else f"frames later than the tracker waits: {counts.late}; they are left out",
        ),
        (counts.repeated, f"frames of a time that is there already: {counts.repeated}; they are left out"),
        (
            counts.early,
            f"frames far ahead of all others, as by a wrong clock: {counts.early}; they are left out",
        ),
        (unknown, f"boxes of classes that are not known ({dataset}), left out: {unknown}"),
        (counts.other_classes, f"boxes of classes that are no road users, left out: {counts.other_classes}"),
        (
            counts.without_score,
            f"boxes whose score is none in [0, 1], left out: {counts.without_score}; scores of log odds are "
            "read by drive alone, which knows all of them before the first frame",
        ),
        (
            counts.rejected - counts.without_score and detector,
            f"boxes that are impossible, left out: {counts.rejected - counts.without_score}",
        ),
        (counts.under_threshold, f"boxes with a score under the threshold: {counts.under_threshold}"),
    )
    notes = [text for number, text in lines if number]
    velocity_frame = settings.velocity_frame if detector is None else detector.velocity_frame
    axes = perception.velocities[name].note(velocity_frame)
    return notes if axes is None else [*notes, axes]


BAG_MEASURES = (
    "requests", "warnings", "frames", "boxes", "tracks", "rejected_boxes", "late_frames", "without_pose",
)  # fmt: skip
"""Of a bag, for gates; docs/gates.md has their meaning."""


def side_of_bag(result: BagResult) -> Side:
    """What perception came to, with the times of its requests from the first frame on."""
    counts, start_s = result.counts, 1e-9 * (result.start_ns or 0)
    asked: dict[bool, list[str]] = {True: [], False: []}
    for request in result.requests:
        asked[request.kind == EMERGENCY].append(f"{request.category} at {request.time_s - start_s:.2f} s")
    values: dict[str, float | None] = {
        "requests": float(len(asked[True])),
        "warnings": float(len(asked[False])),
        "frames": float(counts.frames),
        "boxes": float(counts.boxes),
        "tracks": float(counts.tracks),
        "rejected_boxes": float(counts.rejected + sum(counts.unknown_classes.values())),
        "late_frames": float(counts.late),
        "without_pose": float(counts.without_pose),
    }
    return Side(result.strategy, values, runs={"requests": asked[True], "warnings": asked[False]})


def summary_table(result: BagResult) -> Table:
    """One line: what came, what was tracked, and what was left out."""
    counts = result.counts
    columns = {
        "frames": counts.frames,
        "boxes": counts.boxes,
        "tracks": counts.tracks,
        "requests": counts.requests,
        "rejected boxes": counts.rejected + sum(counts.unknown_classes.values()),
        "late frames": counts.late,
        "without pose": counts.without_pose,
    }
    return Table(tuple(columns), (tuple(map(str, columns.values())),))


def request_table(result: BagResult) -> Table:
    """What would have been braked or warned for; times are from the first frame on."""
    header = ("time (s)", "request", "speed (km/h)", "track", "class", "TTC (s)", "gap (m)")
    start_s = 0.0 if result.start_ns is None else result.start_ns * 1e-9
    return Table(
        header,
        tuple(
            (
                fixed(request.time_s - start_s, 2),
                request.kind,
                fixed(3.6 * request.speed_mps, 1),
                EMPTY if request.track_id is None else str(request.track_id),
                request.category or EMPTY,
                EMPTY if request.ttc_s is None else fixed(request.ttc_s, 2),
                EMPTY if request.gap_m is None else fixed(request.gap_m, 1),
            )
            for request in result.requests
        ),
    )
