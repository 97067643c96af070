"""Many runs, in Python: sweeps, protocols, comparisons, recorded drives."""

from __future__ import annotations

import io
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import rich.console

from evaluation.api.inputs import (
    CPNA,
    asked_runs,
    place_of,
    processes_for,
    setting,
    settings_of,
    several,
    strategy_name,
    varied_settings,
    weather_names,
)
from evaluation.api.results import Results
from evaluation.api.single_run import default_preset
from evaluation.errors import ArgumentError
from evaluation.runs.folder_lock import locked, writable_folder
from evaluation.runs.specs import Conditions
from evaluation.studies.suite import compare_cpna, compare_files
from scenarios.scenes.scenes import scene_names
from scenarios.spec import RunSpec
from smartmot.errors import suggestion

if TYPE_CHECKING:
    from scenarios.places import Place

_TEXT_WIDTH = 110
"""Characters in a line of `Results.text`."""


@dataclass(frozen=True, slots=True)
class _Place:
    """Where a study writes: the folder, and a console that keeps what is printed."""

    folder: Path
    console: rich.console.Console
    is_temporary: bool

    def results(self) -> Results:
        """What was written and printed."""
        file = self.console.file
        assert isinstance(file, io.StringIO)
        lines = (line.rstrip() for line in file.getvalue().splitlines())
        return Results(self.folder, "\n".join(lines).strip("\n"), self.is_temporary)


@contextmanager
def _writing(out: str | Path | None) -> Iterator[_Place]:
    """A folder of the user's, or a temporary one, locked; and a console that keeps what is printed."""
    folder = Path(tempfile.mkdtemp(prefix="smartmot-") if out is None else out)
    console = rich.console.Console(file=io.StringIO(), width=_TEXT_WIDTH, force_jupyter=False)
    try:
        with locked(writable_folder(folder)):
            yield _Place(folder, console, out is None)
    except BaseException:
        if out is None:
            shutil.rmtree(folder, ignore_errors=True)
        raise


def sweep(
    scenario: str | Path = CPNA,
    *,
    speed_kmh: float | Sequence[float] | None = None,
    strategy: str | object | Sequence[str | object] = ("rectangular", "map"),
    preset: str | None = None,
    weather: str | Sequence[str] = "dry",
    tracker: str | object | None = None,
    detector: str | object | None = None,
    rule: str | object | None = None,
    sensor: str | None = None,
    perception: str | object | None = None,
    map_name: str | Path | None = None,
    at: str | Place | tuple[str, int, float] | None = None,
    parameters: Mapping[str, object] | None = None,
    settings: Mapping[str, object] | None = None,
    adversaries: str = "none",
    hold_speed: bool = False,
    seed: int = 0,
    workers: int | None = None,
    out: str | Path | None = None,
) -> Results:
    """Carry out all runs of a scenario: at every speed, with every strategy, in every weather.

    What `smartmot-eval cpna` and `run` do; `frame()` has their rows, those of `runs.csv`.

    Args:
        scenario: `cpna`, the name of a shipped scenario, or an OpenSCENARIO file; see `run`.
        speed_kmh: test speeds, one or several; None: 10, 20, ... 60 for `cpna`, else what the file asks for.
        strategy: monitored areas, one or several; see `run`.
        preset: paper, physical or real; None: paper for `cpna` and physical for all others.
        weather: dry, wet, rain or snow, one or several.
        tracker: name of a configuration, or an own one; None: the preset's.
        detector: an own one; None: the preset's sensor.
        rule: name of a brake rule, or an own one; None: the paper's.
        sensor: a LiDAR; None: boxes of the ground truth with the preset's errors.
        perception: what makes detections of its clouds.
        map_name: a file or shipped map; see `run`.
        at: of `cpna` the place of the pedestrian's line.
        parameters: values of the scenario's parameters.
        settings: parameters of perception that depart from the preset.
        adversaries: of `cpna`: none, or static.
        hold_speed: as in tests of Euro NCAP.
        seed: of the errors of sensor and localisation.
        workers: processes; None: one per core, or this process alone where an object of the user's own is
            no class or function that can be imported. The results are the same for any number.
        out: folder for tables and logs; None: a temporary one.

    Raises:
        ArgumentError, scenarios.errors.ScenarioError, smartmot.SmartMotError, opendrive.OpenDriveError: see
            `run`.
        evaluation.results.files.ResultsError: the folder cannot be written.
    """
    conditions = Conditions(
        strategies=tuple(map(strategy_name, several(strategy))),
        preset=preset or default_preset(scenario),
        weather=weather_names(weather),
        map_name=None if map_name is None else str(map_name),
        adversaries=adversaries,
        seed=seed,
        adapts=not hold_speed,
        settings=settings_of(
            {"tracker": tracker, "detector": detector, "rule": rule, "sensor": sensor},
            {"perception": perception, **(settings or {})},
        ),
    )
    speeds = () if speed_kmh is None else tuple(map(float, several(speed_kmh)))
    asked = asked_runs(scenario, conditions, speeds, parameters or {}, place_of(at))
    processes = processes_for(workers, _plugins(asked.specs))
    with _writing(out) as place:
        for note in asked.notes:
            place.console.print(note, highlight=False)
        if asked.suite is not None:
            compare_cpna(asked.suite, place.folder, None, processes, console=place.console)
        else:
            compare_files(asked.specs, place.folder, None, processes, console=place.console)
        return place.results()


def ncap(
    protocol: str | Path = "2023",
    tests: str | Path | Sequence[str | Path] = (),
    *,
    strategy: str | object | Sequence[str | object] = ("rectangular", "map"),
    preset: str = "physical",
    weather: str | Sequence[str] = "dry",
    tracker: str | object | None = None,
    detector: str | object | None = None,
    rule: str | object | None = None,
    sensor: str | None = None,
    perception: str | object | None = None,
    settings: Mapping[str, object] | None = None,
    robustness: bool = True,
    seed: int = 0,
    logs: bool = False,
    workers: int | None = None,
    out: str | Path | None = None,
) -> Results:
    """Run every cell of a test protocol and score it, as `smartmot-eval ncap` does.

    `frame()` has a row per run, `frame("cells")` the points of each cell.

    Args:
        protocol: 2023, 2026 (Euro NCAP), paper, r152, fmvss127, or a file of the user's own (.toml).
        tests: names of shipped tests, or scenario files and folders; none: all shipped ones.
        strategy: monitored areas, one or several; see `run`.
        preset: paper, physical or real.
        weather: one, or several with the paper's protocol.
        tracker: name of a configuration, or an own one; None: the preset's.
        detector: an own one; None: the preset's sensor.
        rule: name of a brake rule, or an own one; None: the paper's.
        sensor: a LiDAR; None: boxes of the ground truth with the preset's errors.
        perception: what makes detections of its clouds.
        settings: parameters of perception that depart from the preset.
        robustness: of 2026: whether the cells are run under robustness conditions too.
        seed: of the errors of sensor and localisation.
        logs: whether the log of every run is kept, for `log`, `report` and `replay`.
        workers: processes; see `sweep`.
        out: folder for tables and matrices; None: a temporary one.

    Raises:
        ArgumentError: an unknown name.
        evaluation.protocols.errors.ProtocolError: the tests or conditions do not fit the protocol.
    """
    from evaluation.protocols.registry import ALIASES, PROTOCOLS, is_file
    from evaluation.studies.ncap.run import run_grid

    name = ALIASES.get(str(protocol), str(protocol))
    if not is_file(name) and name not in PROTOCOLS:
        raise ArgumentError(
            f"protocol: unknown {name!r}{suggestion(name, (*PROTOCOLS, *ALIASES))}; use one of: "
            f"{', '.join((*PROTOCOLS, *ALIASES))}, or a file"
        )
    conditions = Conditions(
        strategies=tuple(map(strategy_name, several(strategy))),
        preset=preset,
        weather=weather_names(weather),
        seed=seed,
        adapts=name == "paper",
        settings=settings_of(
            {"tracker": tracker, "detector": detector, "rule": rule, "sensor": sensor},
            {"perception": perception, **(settings or {})},
        ),
    )
    named = (*conditions.strategies, *(str(value) for _, value in conditions.settings))
    processes = processes_for(workers, named)
    paths = [str(test) for test in several(tests)]
    with _writing(out) as place:
        run_grid(paths, name, conditions, place.folder, processes, place.console, logs, robustness=robustness)
        return place.results()


def compare(
    strategies: str | object | Sequence[str | object] = ("rectangular", "map", "all", "path"),
    *,
    vary: Mapping[str, object] | None = None,
    scenes: str | Sequence[str] = (),
    preset: str = "physical",
    weather: str | Sequence[str] = "dry",
    seeds: int = 2,
    settings: Mapping[str, object] | None = None,
    logs: bool = False,
    workers: int | None = None,
    out: str | Path | None = None,
) -> Results:
    """Compare strategies and settings over scenes, as `smartmot-eval compare` does.

    `frame()` has a row per run, `frame("table")` a summary per strategy and settings, `frame("differences")`
    what is set against what.

    Args:
        strategies: monitored areas; see `run`.
        vary: values by parameter: `{"margin_m": (0, 1, 2), "tracker": ("preset", MyTracker)}`; none: the
            width of each area with all else alike, and each strategy as the preset has it.
        scenes: names of scenes; none: all of them (docs/study.md).
        preset: paper, physical or real.
        weather: conditions, one or several.
        seeds: repetitions, each with its own noise.
        settings: parameters that all runs have in place of the preset's.
        logs: whether a run per scene and strategy is logged into a folder `runs` of the results.
        workers: processes; see `sweep`.
        out: folder for tables and the journal, from which a comparison that was stopped goes on; None: a
            temporary one.

    Raises:
        ArgumentError: an unknown name, or a value out of range.
        scenarios.errors.ScenarioError, smartmot.SmartMotError: see `run`.
    """
    from evaluation.studies.compare.command import compare as carry_out
    from evaluation.studies.compare.study import SceneStudy

    only = several(scenes)
    for name in only:
        if name not in scene_names():
            close = suggestion(str(name), scene_names())
            raise ArgumentError(f"scenes: unknown {name!r}{close}; use: {', '.join(scene_names())}")
    varied = varied_settings(vary)
    study = SceneStudy(
        strategies=tuple(map(strategy_name, several(strategies))),
        preset=preset,
        vary=varied,
        weather=weather_names(weather),
        scenes=only,
        seeds=seeds,
        formats=(),
        common=settings_of(settings or {}),
    )
    values = (str(value) for _, value in (*study.common, *((k, v) for k, vs in varied.items() for v in vs)))
    processes = processes_for(workers, (*study.strategies, *values))
    with _writing(out) as place:
        carry_out(study, place.folder, processes, logs=logs, console=place.console)
        return place.results()


def drive(
    data: str | Path,
    *,
    strategy: str | object | Sequence[str | object] = (),
    rule: str | object | Sequence[str | object] = "paper",
    detections: str | None = None,
    map_file: str | Path | None = None,
    sequences: str | Sequence[str] = (),
    ego_m: Sequence[float] | None = None,
    preset: str = "real",
    vary: Mapping[str, object] | None = None,
    seed: int = 0,
    out: str | Path | None = None,
) -> Results:
    """See and judge recorded drives in open loop, as `smartmot-eval drive` does.

    `frame()` has a row per drive, strategy and rule, `frame("events")` the emergency requests.

    Args:
        data: a data set with ego poses, or a folder of them (docs/mot.md).
        strategy: monitored areas; none: all that the data allow.
        rule: brake rules.
        detections: labels or detections; None: detections where there are any.
        map_file: map in the frame of the ego poses; None: the log's own.
        sequences: only these; none: all.
        ego_m: length and width of the recording vehicle, and how far its middle is ahead of the recorded
            point; None: that of the data set.
        preset: brakes, areas and tracker; with labels also the sensor.
        vary: values by parameter; see `compare`.
        seed: of the errors of labels.
        out: see `sweep`.

    Raises:
        ArgumentError: an unknown name, or a strategy without the map that it needs.
        scenarios.errors.DatasetError: the data cannot be read.
    """
    from evaluation.progress import study_progress
    from evaluation.results.tables import rich_table
    from evaluation.studies.drive.drive import SEES
    from evaluation.studies.drive.recordings import Source
    from evaluation.studies.drive.study import Options, drive_all, prepare
    from scenarios.recorded.vehicles import Vehicle

    if detections is not None and detections not in SEES:
        raise ArgumentError(
            f"detections: unknown {detections!r}{suggestion(detections, SEES)}; use one of: {', '.join(SEES)}"
        )
    source = Source(
        folder=Path(data),
        sequences=",".join(several(sequences)) or None,
        sees=detections,
        map_file=None if map_file is None else Path(map_file),
        vehicle=None if ego_m is None else Vehicle(*ego_m),
    )
    varied = varied_settings(vary)
    asked = Options(
        source,
        tuple(map(strategy_name, several(strategy))),
        tuple(str(setting("rule", each)) for each in several(rule)),
        preset,
        seed,
        varied,
    )
    with _writing(out) as place:
        study = prepare(asked)
        print_note = _notes_to(place.console)
        for note in study.notes:
            print_note(note)
        with study_progress(place.console) as progress:
            result = drive_all(study, place.folder, progress)
        for note in result.notes:
            print_note(note)
        place.console.print(rich_table(result.table, texts=2))
        return place.results()


def _notes_to(console: rich.console.Console) -> Callable[[str], None]:
    """Prints a note on a line of its own."""
    return lambda note: console.print(f"note: {note}", highlight=False, soft_wrap=True, markup=False)


def _plugins(specs: Sequence[RunSpec]) -> tuple[str, ...]:
    """Objects of the user's own that take part in runs."""
    return tuple(dict.fromkeys(name for spec in specs for name in spec.plugins))
