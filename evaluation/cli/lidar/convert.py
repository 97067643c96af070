"""`smartmot-eval lidar convert`: clouds from one kind of file to another."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import is_typed
from evaluation.cli.output import one_line
from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    from scenarios.recorded.clouds.fields import NamedCloud

EXAMPLES = options.examples(
    "`smartmot-eval lidar convert 000001.bin 000001.pcd`",
    "`smartmot-eval lidar convert training/velodyne clouds --to pcd --encoding binary_compressed`",
    "`smartmot-eval lidar convert drive_bag clouds --to bin --topic /velodyne_points`",
    "`smartmot-eval lidar convert training/velodyne drive.mcap`",
    "`smartmot-eval lidar convert radar.bin radar.npz --columns x,y,z,intensity,_,_,time,_`",
    "Formats, and what each holds: docs/lidar.md.",
)


def command(
    context: typer.Context,
    source: Annotated[
        Path,
        typer.Argument(help="File (.bin, .pcd.bin, .pcd, .npz), folder, or bag.", metavar="FROM"),
    ],
    target: Annotated[
        Path, typer.Argument(help="File, folder, or bag (.mcap, .db3) to be written.", metavar="TO")
    ],
    form: Annotated[
        str | None,
        typer.Option("--to", help="Format of the files in a folder: bin, pcd.bin, pcd, npz; or bag."),
    ] = None,
    encoding: Annotated[str, typer.Option(help="Of .pcd: binary, binary_compressed or ascii.")] = "binary",
    topic: Annotated[
        str | None,
        typer.Option(help="Topic of the clouds in a bag. Default: the only one; written: /points."),
    ] = None,
    columns: Annotated[
        str | None,
        typer.Option(
            help="Numbers of a point in .bin files, in their order: x,y,z,intensity,ring,time; _ is not "
            "kept. Default: as KITTI and nuScenes have them.",
            metavar="NAMES",
        ),
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Convert point clouds between KITTI, nuScenes, PCD, NumPy and ROS; says what a format cannot hold."""
    from scenarios.recorded.clouds.bags import write_bag_clouds
    from scenarios.recorded.clouds.files import FORMATS, file_format, read_clouds
    from scenarios.recorded.clouds.pcd import ENCODINGS
    from scenarios.ros.bags.writer import STORAGES

    encoding = options.parse_name(encoding, ENCODINGS, "--encoding")
    form = options.parse_name(form, (*FORMATS, "bag"), "--to") if form else None
    own_form = file_format(target)
    if target.suffix in STORAGES.values():
        own_form = "bag"
    if form and own_form and form != own_form:
        raise ArgumentError(f"--to: {form}, but {target} ends as a {own_form}; leave out one of them")
    if not form and not own_form:
        raise ArgumentError(f"--to: needed for the folder {target}: {', '.join((*FORMATS, 'bag'))}")
    kind = own_form or form or ""
    if kind != "pcd" and is_typed(context, "encoding"):
        raise ArgumentError(f"--encoding: has no effect with {kind}; it is for pcd")
    if source.exists() and target.exists() and source.resolve() == target.resolve():
        raise ArgumentError(f"{target}: is what is read; name another one")
    account = _Account()
    clouds = account.of(read_clouds(source, topic, _names(columns)))
    if kind == "bag":
        count = write_bag_clouds(target, map(account.as_message, clouds), topic)
    elif own_form:
        count = _write(target, _only(clouds, source, kind), kind, encoding, account)
    else:
        count = sum(_write(target / f"{c.name}.{kind}", c, kind, encoding, account) for c in clouds)
    for note in account.notes(count):
        typer.echo(f"smartmot-eval: {one_line(note)}", err=True)
    if not quiet:
        typer.echo(f"{target}: {count} cloud{'' if count == 1 else 's'}, {account.points} points")


class _Account:
    """What is to be said of the clouds that were read and written."""

    def __init__(self) -> None:
        self.points = self.dropped = self.empty = 0
        self.said: Counter[str] = Counter()
        self.names: set[str] = set()

    def of(self, clouds: Iterable[NamedCloud]) -> Iterator[NamedCloud]:
        """The clouds, counted on their way."""
        for named in clouds:
            if named.name in self.names:
                raise ArgumentError(f"two clouds are named {named.name}: convert one format at a time")
            self.empty += not len(named.cloud)
            self.names.add(named.name)
            self.points += len(named.cloud)
            self.dropped += named.dropped
            self.said.update(named.notes)
            yield named

    def as_message(self, named: NamedCloud) -> NamedCloud:
        """A cloud on its way into a bag."""
        from scenarios.recorded.clouds.bags import FRAME, FRAME_S

        if named.cloud.stamp_s is None:
            self.said[f"no time in the cloud: {FRAME_S:g} s after the one before"] += 1
        if not named.cloud.frame:
            self.said[f"no name of the frame: {FRAME}"] += 1
        return named

    def notes(self, count: int) -> Iterator[str]:
        """Every note once, with the number of clouds."""
        if self.dropped:
            yield f"{self.dropped} points with a value that is not finite dropped"
        if self.empty:
            yield f"{self.empty} of {count} clouds have no points"
        for note, times in self.said.items():
            yield f"{note} ({times} clouds)" if count > 1 else note


def _names(columns: str | None) -> tuple[str, ...]:
    """Names of the columns.

    Raises:
        ArgumentError: a coordinate is missing.
    """
    names = () if columns is None else tuple(name.strip() for name in columns.split(","))
    if columns is not None and not {"x", "y", "z"} <= set(names):
        raise ArgumentError(f"--columns: expected x, y and z among the names, got {columns!r}")
    return names


def _only(clouds: Iterator[NamedCloud], source: Path, kind: str) -> NamedCloud:
    """The one cloud that a file can hold."""
    first = list(islice(clouds, 2))
    if len(first) != 1:
        count = "several clouds" if first else "no cloud"
        raise ArgumentError(f"{source}: {count}; for several name a folder and --to {kind}")
    if not len(first[0].cloud):
        raise ArgumentError(f"{source}: no points to convert")
    return first[0]


def _write(path: Path, named: NamedCloud, kind: str, encoding: str, account: _Account) -> int:
    """Write one cloud and note what is lost."""
    from evaluation.results.files import write_bytes
    from scenarios.errors import DatasetError
    from scenarios.recorded.clouds.files import cloud_bytes, losses

    account.said.update(losses(named.cloud, kind))
    try:
        content = cloud_bytes(named.cloud, kind, encoding)
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}") from None
    write_bytes(path, content)
    return 1
