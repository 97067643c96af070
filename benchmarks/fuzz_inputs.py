"""Damages folders of runs and recordings at random and looks what the commands say of them.

    python -m benchmarks.fuzz_inputs --cases 10000 --seed 1

Half of the cases are damaged in their bytes; the other half in their structure, so that they pass the first
parse: values of another kind or size, missing and doubled keys, other lengths. Every command has to end well,
or with status 2 and one line. Anything else is printed with the number of its case, which `--only` repeats
and whose folder it keeps. The test suite runs a short, seeded part of this.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import io
import json
import random
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

if not __package__:
    # a script's own folder comes first, and has a module of the name opendrive
    sys.path[0] = str(Path(__file__).parents[1])

from evaluation.cli import main
from evaluation.results.logs import LOG_COLUMNS, read_log, write_log
from evaluation.results.rows import write_runs
from evaluation.runs.configuration import configuration_of, read_configuration

DATA = Path(__file__).parents[1] / "tests" / "data"
FIELD = DATA / "field" / "runs" / "good"
LOG = "cpna_paper_map_dry_none_50kmh_seed0"
INPUTS = "inputs"
"""Folder in the folder of a base that has what is damaged."""

HANG_S = 60
"""A case that takes longer hangs: the slowest takes 3 s."""

READ, REFUSED, BAD, HANGS = "read", "refused in one line", "tracebacks or other output", "hangs"


# ---- bases -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Base:
    """A sound folder, and the commands that read it.

    Args:
        name: of the kind of input.
        make: writes it into an empty folder.
        commands: arguments with DIR for the folder; one is drawn at random.
        weights: how often each of them is drawn.
    """

    name: str
    make: Callable[[Path], None]
    commands: tuple[tuple[str, ...], ...]
    weights: tuple[float, ...]


def _first_runs(folder: Path) -> None:
    """Runs of version 0.1.0, with few frames."""
    shutil.copytree(FIELD, folder, dirs_exist_ok=True)
    path = folder / "logs" / f"{LOG}.parquet"
    log = read_log(path)
    time_s = log["time_s"]
    log = log[(time_s < 0.12) | ((time_s > 3.08) & (time_s < 3.22)) | (time_s > 7.7)]
    texts = ("kind", "category", "label")
    write_log(
        path,
        {
            name: log[name].fillna("").to_numpy(object) if name in texts else log[name].to_numpy(np.float64)
            for name in LOG_COLUMNS
        },
    )


def _runs(folder: Path) -> None:
    """Runs of this version."""
    _first_runs(folder)
    table = (folder / "runs.csv").read_bytes()
    specs = [run.spec for run in read_configuration(folder).runs]
    write_runs(folder, [], configuration_of(specs, folder))
    (folder / "runs.csv").write_bytes(table)


_FRAMES = 4


def _nuscenes(folder: Path) -> None:
    """Two cars in four samples, and the small table of times."""
    boxes = {f"t{k}": [_box(f"t{k}", 20.0 + k, 1.0), _box(f"t{k}", 30.0, -2.0)] for k in range(_FRAMES)}
    (folder / "detections.json").write_text(json.dumps({"meta": {"use_lidar": True}, "results": boxes}))
    lines = [f"t{k},s,{0.5 * k}" for k in range(_FRAMES)]
    (folder / "frames.csv").write_text("\n".join(["sample_token,scene,stamp_s", *lines, ""]))


def _box(token: str, x: float, y: float) -> dict[str, Any]:
    return {
        "sample_token": token, "translation": [x, y, 0.8], "size": [1.8, 4.2, 1.5],
        "rotation": [1.0, 0.0, 0.0, 0.0], "velocity": [2.0, 0.0],
        "detection_name": "car", "detection_score": 0.8, "attribute_name": "",
    }  # fmt: skip


def _nuscenes_tables(folder: Path) -> None:
    """The same with nuScenes' own tables, labels and poses."""
    _nuscenes(folder)
    (folder / "frames.csv").unlink()
    samples = range(_FRAMES)
    tables: dict[str, list[dict[str, Any]]] = {
        "scene": [{"token": "s", "name": "scene-1"}],
        "sample": [{"token": f"t{k}", "scene_token": "s", "timestamp": 500_000 * k} for k in samples],
        "category": [{"token": "c", "name": "vehicle.car"}],
        "instance": [{"token": "i", "category_token": "c"}],
        "sample_annotation": [
            {
                k: v
                for k, v in _box(f"t{k}", 20.0 + k, 1.0).items()
                if k in ("translation", "size", "rotation")
            }
            | {"sample_token": f"t{k}", "instance_token": "i", "num_lidar_pts": 5}
            for k in samples
        ],
        "sensor": [{"token": "l", "channel": "LIDAR_TOP"}],
        "calibrated_sensor": [{"token": "m", "sensor_token": "l"}],
        "sample_data": [
            {
                "sample_token": f"t{k}",
                "ego_pose_token": f"p{k}",
                "calibrated_sensor_token": "m",
                "is_key_frame": True,
            }
            for k in samples
        ],
        "ego_pose": [
            {"token": f"p{k}", "translation": [float(k), 0.0, 0.0], "rotation": [1.0, 0.0, 0.0, 0.0]}
            for k in samples
        ],
    }
    for name, rows in tables.items():
        (folder / f"{name}.json").write_text(json.dumps(rows))


def _csv(folder: Path) -> None:
    """Detections, labels and poses as tables."""
    box = "4.2,1.8,0.1"
    seen = [f"s,{0.1 * k:.1f},{20 + k}.0,1.0,{box},0.8,car" for k in range(_FRAMES)]
    true = [f"s,{0.1 * k:.1f},{20 + k}.1,1.1,{box},7,car" for k in range(_FRAMES)]
    poses = [f"s,{0.1 * k:.1f},{k}.0,0.0,0.0" for k in range(_FRAMES)]
    head = "sequence,stamp_s,x_m,y_m,length_m,width_m,yaw_rad"
    (folder / "detections.csv").write_text("\n".join([f"{head},score,category", *seen, ""]))
    (folder / "labels.csv").write_text("\n".join([f"{head},track_id,category", *true, ""]))
    (folder / "ego.csv").write_text("\n".join(["sequence,stamp_s,x_m,y_m,yaw_rad", *poses, ""]))


def _parquet(folder: Path) -> None:
    """The same tables as Parquet files."""
    _csv(folder)
    for path in sorted(folder.glob("*.csv")):
        pd.read_csv(path).to_parquet(path.with_suffix(".parquet"))
        path.unlink()


def _argoverse(folder: Path) -> None:
    """A log with labels, detections, poses and a map of one lane."""
    stamps = [10**15 + 100_000_000 * k for k in range(_FRAMES)]
    turn = {"qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}
    boxes = [
        {"timestamp_ns": t, "category": kind, "length_m": 4.2, "width_m": 1.8, "height_m": 1.5}
        | turn
        | {"tx_m": x, "ty_m": 1.0, "tz_m": 0.8}
        for t in stamps
        for kind, x in (("REGULAR_VEHICLE", 20.0), ("PEDESTRIAN", 30.0), ("BOLLARD", 5.0))
    ]
    labels = [
        box | {"track_uuid": box["category"].lower(), "num_interior_pts": k % 3}
        for k, box in enumerate(boxes)
    ]
    poses = [
        {"timestamp_ns": t} | turn | {"tx_m": 1.0 * k, "ty_m": 0.0, "tz_m": 0.0} for k, t in enumerate(stamps)
    ]
    for name, rows in (
        ("annotations", labels),
        ("detections", [box | {"score": 0.8} for box in boxes]),
        ("city_SE3_egovehicle", poses),
    ):
        pd.DataFrame(rows).to_feather(folder / f"{name}.feather")
    left, right = ([{"x": x, "y": y, "z": 0.0} for x in (-50.0, 80.0)] for y in (1.75, -1.75))
    lane = {
        "id": 1, "is_intersection": False, "lane_type": "VEHICLE", "left_lane_boundary": left,
        "right_lane_boundary": right, "left_lane_mark_type": "DASHED_WHITE",
        "right_lane_mark_type": "SOLID_WHITE", "successors": [2], "predecessors": [],
        "left_neighbor_id": None, "right_neighbor_id": None,
    }  # fmt: skip
    street = [{"x": x, "y": y, "z": 0.0} for x, y in ((-50.0, -3.0), (80.0, -3.0), (80.0, 3.0), (-50.0, 3.0))]
    content = {
        "lane_segments": {"1": lane},
        "drivable_areas": {"1": {"area_boundary": street, "id": 1}},
        "pedestrian_crossings": {"5": {"edge1": street[:2], "edge2": street[2:], "id": 5}},
    }
    (folder / "map").mkdir()
    (folder / "map" / "log_map_archive_here.json").write_text(json.dumps(content))


def _simbev(folder: Path) -> None:
    """Two scenes, their labels in both forms."""
    shutil.copytree(DATA / "simbev", folder, dirs_exist_ok=True)


def _kitti(folder: Path) -> None:
    """AB3DMOT's detections, KITTI's labels, calibration, poses and times."""
    size = "1.5,1.8,4.2"
    seen = [f"{k},2,100.0,100.0,200.0,200.0,3.2,{size},1.0,1.6,{20 + k}.0,0.1,0.0" for k in range(_FRAMES)]
    true = [
        f"{k} 3 Car 0 0 0.0 100.0 100.0 200.0 200.0 1.5 1.8 4.2 1.0 1.6 {20 + k}.1 0.1"
        for k in range(_FRAMES)
    ]
    files = {
        "detections/Car/0000.txt": seen,
        "label_02/0000.txt": true,
        "calib/0000.txt": ["P2: 700 0 600 45 0 700 170 0.2 0 0 1 0.003"],
        "ego_pose/0000.txt": [f"1 0 0 0 0 1 0 0 0 0 1 {k}" for k in range(_FRAMES)],
        "times/0000.txt": [f"{0.1 * k:.1f}" for k in range(_FRAMES)],
        "seqmap.txt": [f"0000 empty 000000 {_FRAMES:06d}"],
    }
    for name, lines in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text("\n".join([*lines, ""]))


_OF_RUNS = (
    ("report", "DIR", "--out", "OUT/page.html"),
    ("replay", f"DIR/{LOG}", "--gif", "OUT/film.gif", "--fps", "1"),
    ("plot", "DIR"),
)
_MOT = ("mot", "DIR", "--out", "OUT")
_DRIVE = ("drive", "DIR", "--out", "OUT", "--no-page", "--strategy", "all")


def _recorded(form: str, *drives: tuple[str, ...]) -> tuple[tuple[str, ...], ...]:
    """Commands on recordings of a format."""
    return (
        (*_MOT, "--format", form),
        *((*_DRIVE, "--format", form, *further) for further in drives or ((),)),
    )


_LABELS = ("--detections", "labels")
BASES = (
    Base("run folder", _runs, _OF_RUNS, (90, 6, 4)),
    Base("run folder of 0.1.0", _first_runs, _OF_RUNS, (90, 6, 4)),
    Base("nuScenes", _nuscenes, ((*_MOT, "--format", "nuscenes"),), (1,)),
    Base("nuScenes tables", _nuscenes_tables, _recorded("nuscenes", _LABELS), (1, 1)),
    Base("CSV", _csv, _recorded("csv"), (1, 1)),
    Base("Parquet", _parquet, _recorded("csv", _LABELS), (1, 1)),
    Base("KITTI", _kitti, _recorded("kitti"), (1, 1)),
    Base("Argoverse 2", _argoverse, _recorded("argoverse", (), ("--strategy", "map", *_LABELS)), (1, 1, 1)),
    Base("SimBEV", _simbev, _recorded("simbev"), (1, 1)),
)
SHARES = (5, 2, 1, 1, 1, 1, 1, 1, 1)
"""How often each of them is drawn: run folders in half of the cases."""


# ---- damage ------------------------------------------------------------------------------------------------

_DEEP: list[Any] = []
for _ in range(300):
    _DEEP = [_DEEP]
_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2**63, -(2**70), 10**400, 0.5, -0.0, 1e308, -1e308, 1e-320, float("nan"),
    float("inf"), "", "x", "0", "nan", "1e999", "\0", "\ud800", "a\nb", "..", "../../..", "x" * 300,
    "\N{BELL}", [], {}, [None], [[]], {"": 0}, {"name": "evil", "digest": "0"}, {"file": "x"}, _DEEP,
    "smartmot:../x", "evil:Area",
)  # fmt: skip
_TEXTS = (
    "", "x", "nan", "inf", "-inf", "1e308", "-1e308", "1e999", "1e-320", "0", "-1", "99999999999999999999",
    "1" * 400, "true", "\0", '"', ",", "\t", "\N{ARABIC-INDIC DIGIT THREE}", "1_0", "0x10", "..", "../x",
    "x" * 300, "a\rb",
)  # fmt: skip


def damage_bytes(path: Path, rng: random.Random) -> None:
    """Cut, change, drop or repeat bytes of a file; or take the file away."""
    data = path.read_bytes()
    at = rng.randrange(len(data) + 1)
    match rng.randrange(8):
        case 0:
            data = data[:at]
        case 1 | 2:
            for _ in range(rng.randint(1, 5)):
                at = rng.randrange(len(data) + 1)
                data = data[:at] + bytes([rng.randrange(256)]) + data[at + 1 :]
        case 3:
            data = data[:at] + data[at + rng.randrange(200) :]
        case 4:
            data = data[:at] + data[max(0, at - rng.randrange(500)) :]
        case 5:
            data = data[:at] + rng.choice((b"\0", b"\xff\xfe", b"\n\n", b'"', b"[" * 100_000)) + data[at:]
        case 6:
            path.unlink()
            if rng.random() < 0.5:
                path.mkdir()
            return
        case _:
            data = b"\xef\xbb\xbf" + data if rng.random() < 0.5 else b""
    path.write_bytes(data)


def damage_structure(path: Path, rng: random.Random) -> None:
    """Change what a file says, so that it can still be parsed."""
    if path.suffix == ".json":
        path.write_text(_damaged_json(path.read_text(), rng))
    elif path.suffix in (".parquet", ".feather"):
        _damage_columns(path, rng)
    else:
        path.write_text(
            _damaged_table(path.read_text(), rng, "," if path.suffix == ".csv" else None), newline=""
        )


def _damaged_json(text: str, rng: random.Random) -> str:
    """Values of other kinds, keys that are missing, new or there twice."""
    content = json.loads(text)
    for _ in range(rng.randint(1, 3)):
        places = list(_places(content))
        if not places:
            break
        holder, key = rng.choice(places)
        match rng.randrange(6):
            case 0 | 1 | 2:
                holder[key] = copy.deepcopy(rng.choice(_VALUES))
            case 3:
                del holder[key]
            case 4:
                _, other = rng.choice(places)
                there, where = rng.choice(places)
                holder[key] = copy.deepcopy(there[where])
                if isinstance(holder, dict) and isinstance(other, str):
                    holder[other] = holder.pop(key)
            case _:
                value = holder[key]
                holder[key] = (
                    [value]
                    if rng.random() < 0.5
                    else value * 2
                    if isinstance(value, (str, list))
                    else [value] * 3
                )
    text = json.dumps(content)
    if rng.random() < 0.1:  # a key twice
        at = text.find('": ', rng.randrange(len(text)))
        start = text.rfind('"', 0, at) if at > 0 else -1
        if start > 0:
            text = f"{text[:start]}{text[start : at + 1]}: 0, {text[start:]}"
    return text


def _places(content: Any) -> Iterator[tuple[Any, Any]]:
    """Every value in a structure, as what holds it and its key."""
    todo, depth = [content], 0
    while todo and depth < 20_000:
        depth += 1
        holder = todo.pop()
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        for key in keys:
            yield holder, key
            if isinstance(holder[key], (dict, list)):
                todo.append(holder[key])


def _damaged_table(text: str, rng: random.Random, separator: str | None) -> str:
    """Fields, columns and rows of a text that are others, missing or there twice."""
    rows = [line.split(separator) for line in text.splitlines()]
    if not rows:
        return rng.choice(_TEXTS)
    for _ in range(rng.randint(1, 3)):
        row = rng.choice(rows)
        at = rng.randrange(len(row)) if row else 0
        match rng.randrange(7):
            case 0 | 1 | 2 if row:
                row[at] = rng.choice(_TEXTS)
            case 3:
                rows.remove(row)
                rows = rows or [[]]
            case 4:
                rows.insert(rng.randrange(len(rows) + 1), list(row))
            case 5:
                for cells in rows:  # a column
                    del cells[at : at + 1]
            case _:
                for cells in rows:
                    cells[at:at] = cells[at : at + 1]
    return "\n".join((separator or " ").join(row) for row in rows) + "\n"


_NAMES = ("kind", "category", "label", "track_uuid", "sequence")
"""Columns that hold texts."""


def _damage_columns(path: Path, rng: random.Random) -> None:
    """Columns of another kind, values that cannot be, rows that are missing; of a log without a checksum."""
    feather = path.suffix == ".feather"
    table = pd.read_feather(path) if feather else pd.read_parquet(path)
    for _ in range(rng.randint(1, 3)):
        name = rng.choice(list(table.columns))
        match rng.randrange(8):
            case 0:
                table = table.drop(columns=name) if len(table.columns) > 1 else table
            case 1:
                table = table.rename(columns={name: rng.choice(_TEXTS)})
            case 2:
                table[name] = table[name].astype(str)
            case 3:
                table[name] = rng.choice(
                    (0, 1.0, True, "x", None, 1e308, -1e308, float("nan"), float("inf"), 2**62)
                )
            case 4 | 5 if len(table):
                column = table[name].astype(object).tolist()
                value = (
                    rng.choice(("", "ego", "x", "event", "track", "\0", None, "x" * 300))
                    if name in _NAMES
                    else rng.choice((0.0, -1.0, 1e308, -1e308, float("nan"), float("inf"), 1e-320))
                )
                column[rng.randrange(len(column))] = value
                table[name] = column
            case 6 if "kind" in table:
                table = table[table["kind"] != rng.choice(("ego", "actor", "event", "track"))]
            case _:
                table = (
                    table.iloc[: rng.randrange(len(table) + 1)] if rng.random() < 0.5 else table.iloc[::-1]
                )
    with contextlib.suppress(Exception):  # what cannot be written is no case
        if feather:
            table.reset_index(drop=True).to_feather(path)
        else:
            table.to_parquet(path)


# ---- cases -------------------------------------------------------------------------------------------------


class HangError(BaseException):
    """A case takes too long; no error that the program could take for its own."""


@dataclass(frozen=True)
class Result:
    """What became of a case.

    Args:
        kind: one of READ, REFUSED, BAD, HANGS.
        base: kind of input.
        words: the command.
        errors: what it printed to the error output.
    """

    kind: str
    base: str
    words: tuple[str, ...]
    errors: str


def make_bases(folder: Path) -> list[Path]:
    """Write all bases into a folder, once for all cases."""
    made = []
    for number, base in enumerate(BASES):
        path = folder / str(number)
        path.mkdir()
        base.make(path)
        made.append(path)
    return made


def carry_out(case: int, seed: int, bases: list[Path], folder: Path) -> Result:
    """Damage a copy of a base and run a command on it.

    Args:
        case: number; even ones are damaged in their bytes, odd ones in their structure.
        seed: of all cases.
        bases: from `make_bases`.
        folder: empty; for the copy and what the command writes.
    """
    rng = random.Random(f"{seed} {case}")
    number = rng.choices(range(len(BASES)), SHARES)[0]
    base = BASES[number]
    damaged = folder / INPUTS
    shutil.copytree(bases[number], damaged)
    files = sorted(path for path in damaged.rglob("*") if path.is_file())
    if case % 2:
        files = [path for path in files if path.suffix != ".bin"]
        damage_structure(rng.choice(files), rng)
    else:
        damage_bytes(rng.choice(files), rng)
    words = rng.choices(base.commands, base.weights)[0]
    words = tuple(word.replace("DIR", str(damaged)).replace("OUT", str(folder)) for word in words)
    return _run(base.name, (*words, "--quiet"))


def _run(base: str, words: tuple[str, ...]) -> Result:
    """A command in this process, and what it prints."""
    out, errors = io.StringIO(), io.StringIO()
    before, sys.argv = sys.argv, ["smartmot-eval", *words]
    status: object = 0

    def hang(*_: object) -> None:
        raise HangError

    previous = signal.signal(signal.SIGALRM, hang)
    signal.alarm(HANG_S)
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(errors), warnings.catch_warnings():
            warnings.simplefilter("always")
            warnings.showwarning = lambda *a, **k: errors.write(f"warning: {a[0]} {a[2]}:{a[3]}\n")  # type: ignore[assignment]
            main()
    except SystemExit as stop:
        status = stop.code
    except HangError:
        return Result(HANGS, base, words, traceback.format_exc())
    except BaseException:
        return Result(BAD, base, words, traceback.format_exc())
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, previous)
        sys.argv = before
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")
    lines = errors.getvalue().splitlines()
    ours = all(line.startswith("smartmot-eval: ") for line in lines)
    if not status and ours:
        return Result(READ, base, words, errors.getvalue())
    if status == 2 and ours and len(lines) == 1:
        return Result(REFUSED, base, words, errors.getvalue())
    return Result(BAD, base, words, f"status {status}\n{errors.getvalue()}")


def fuzz(cases: int, seed: int, tell: Callable[[str], None] = lambda line: None) -> Counter[tuple[str, str]]:
    """Carry out cases; counts by kind of input and result, failures told as they come."""
    counts: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as root:
        bases = make_bases(Path(root))
        for case in range(cases):
            with tempfile.TemporaryDirectory() as folder:
                result = carry_out(case, seed, bases, Path(folder))
            counts[result.base, result.kind] += 1
            if result.kind in (BAD, HANGS):
                tell(f"--seed {seed} --only {case}: {' '.join(result.words)}\n{result.errors}")
    return counts


def only(case: int, seed: int) -> Result:
    """One case again; its folder is kept."""
    with tempfile.TemporaryDirectory() as root:
        kept = Path(tempfile.mkdtemp(prefix="fuzz_"))
        return carry_out(case, seed, make_bases(Path(root)), kept)


def _main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cases", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="number of a case to repeat")
    options = parser.parse_args()
    if options.only is not None:
        result = only(options.only, options.seed)
        sys.stdout.write(f"{result.base}: {result.kind}\n{' '.join(result.words)}\n{result.errors}\n")
        return result.kind in (BAD, HANGS)
    start = time.perf_counter()
    counts = fuzz(options.cases, options.seed, lambda line: print(line, flush=True))
    kinds = (READ, REFUSED, BAD, HANGS)
    lines = [
        f"{base.name}: " + ", ".join(f"{counts[base.name, kind]} {kind}" for kind in kinds) for base in BASES
    ]
    total = {kind: sum(counts[base.name, kind] for base in BASES) for kind in kinds}
    lines.append(f"{sum(counts.values())} cases: " + ", ".join(f"{total[kind]} {kind}" for kind in kinds))
    sys.stdout.write("\n".join([*lines, f"{time.perf_counter() - start:.0f} s", ""]))
    return bool(total[BAD] + total[HANGS])


if __name__ == "__main__":
    raise SystemExit(_main())
