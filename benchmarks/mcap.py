"""Time of writing an MCAP over that of the run itself, per run of a folder: python -m benchmarks.mcap DIR.

The run is carried out again, the log is read again; processor time, least of five.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from evaluation.results.files import log_path
from evaluation.runs.configuration import read_configuration
from evaluation.runs.execution import execute
from evaluation.runs.folder import read_folder, read_shown_log
from evaluation.studies.drive.drive import carry_out
from evaluation.studies.drive.folder import is_drive_folder, read_drive_folder
from evaluation.views.traces.folders import logged_run
from evaluation.views.traces.mcap import mcap_bytes

GOAL = 0.5
REPEATS = 5


def least_s(call: Callable[[], object]) -> float:
    """Processor time of a call."""
    spent = []
    for _ in range(REPEATS):
        start = time.process_time()
        call()
        spent.append(time.process_time() - start)
    return min(spent)


def runs_of(folder: Path) -> list[tuple[str, Callable[[], object], Callable[[], object]]]:
    """Name, run and writer of each run of a folder, without what is done once for all of them."""
    calls: list[tuple[str, Callable[[], object], Callable[[], object]]] = []
    if is_drive_folder(folder):
        drives = read_drive_folder(folder)
        for row in drives.drives:
            recording = drives.recordings[row["sequence"]]
            spec = replace(drives.specs[row["strategy"], row["settings"]], vehicle=recording.vehicle)
            spec = replace(spec, rule=row["rule"])
            calls.append(
                (
                    row["log"],
                    lambda r=recording, spec=spec: carry_out(r.sequence, spec, r.network),
                    lambda log=row["log"]: mcap_bytes(drives.logged_run(log)),
                )
            )
        return calls
    read_folder(folder)  # imports, and maps that are kept
    for stored in read_configuration(folder).runs:
        name = stored.spec.log
        run, _ = logged_run(folder / name)

        def write(run=run, name=name) -> object:
            read_shown_log(log_path(folder, name))
            return mcap_bytes(run)

        calls.append((name, lambda spec=stored.spec: execute(spec), write))
    return calls


def main() -> None:
    """Print a line per run."""
    if len(sys.argv) != 2:
        sys.exit("usage: python -m benchmarks.mcap DIR, a folder that cpna, run, ncap --logs or drive wrote")
    for name, run, write in runs_of(Path(sys.argv[1])):
        run()
        run_s, write_s = least_s(run), least_s(write)
        verdict = "" if write_s <= GOAL * run_s else f"; over the goal of {GOAL:g}"
        print(f"{name}: run {run_s:.3f} s, MCAP {write_s:.3f} s, ratio {write_s / run_s:.2f}{verdict}")


if __name__ == "__main__":
    main()
