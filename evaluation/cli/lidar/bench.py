"""`smartmot-eval lidar bench`: processor time of the detectors, stage by stage."""

from __future__ import annotations

import time
from collections import Counter
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.lidar.detect import (
    NETWORK_ENDING,
    Ahead,
    Clouds,
    Topic,
    parse_ahead,
    parse_method,
    print_notes,
)

EXAMPLES = options.examples(
    "`smartmot-eval lidar bench training/velodyne`",
    "`smartmot-eval lidar bench 000001.bin 000003.bin --method classical,plain --rounds 50`",
)


def command(
    clouds: Clouds,
    method: Annotated[
        str, typer.Option(help="classical, pillars, plain, or FILE.onnx; comma-separated.")
    ] = "classical",
    rounds: Annotated[int, typer.Option(help="How often each cloud is taken.", min=1)] = 10,
    ahead: Ahead = None,
    topic: Topic = None,
    quiet: options.Quiet = False,
) -> None:
    """Milliseconds of each stage of a detector, with points, boxes and the host's processor."""
    import statistics

    import rich.console

    from evaluation.cli.output import counting
    from evaluation.results.tables import rich_table
    from evaluation.studies.lidar.detect import Account, clouds_of, detected_cloud, stage_table
    from smartmot.lidar import METHODS
    from smartmot.lidar.learned import SHIPPED

    words = [word.strip() for word in method.split(",")]
    networks = [word for word in words if word.endswith(NETWORK_ENDING)]
    others = ",".join(word for word in words if word not in networks)
    known = options.parse_names(others, (*METHODS, *SHIPPED), "--method") if others or not networks else ()
    names = sorted({*known, *networks}, key=words.index)
    console = rich.console.Console()
    read, spent_s, notes = [], [], Counter[str]()
    start_s = time.thread_time()
    for named in clouds_of(clouds, topic, parse_ahead(ahead)):
        spent_s.append(time.thread_time() - start_s)
        read.append(named)
        notes.update(named.notes)
        start_s = time.thread_time()
    print_notes(notes, len(read))
    points = sorted(len(named.cloud) for named in read)
    with counting("measuring", quiet) as done:
        tables = []
        for number, name in enumerate(names):
            config, account = parse_method(name, None), Account()
            detected_cloud(read[0], config)  # what is loaded and tabulated at the first call is not counted
            for turn in range(rounds):
                for named in read:
                    account.add(detected_cloud(named, config))
                done(number * rounds + turn + 1, rounds * len(names))
            tables.append((name, stage_table(account)))
    console.print(
        f"{len(read)} cloud{'s' * (len(read) > 1)}, {points[len(points) // 2]} points in the median; "
        f"reading one {1e3 * statistics.median(spent_s):.2f} ms",
        highlight=False,
    )
    for name, table in tables:
        console.print(rich_table(table, name, texts=1), "")
