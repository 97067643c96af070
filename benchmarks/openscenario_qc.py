"""Verdicts of ASAM's checker beside ours: `python -m benchmarks.openscenario_qc FOLDER`.

The checker is `qc_openscenario` of asam-qc-openscenarioxml (`pip install asam-qc-openscenarioxml` in an
environment of its own), on the PATH or named with `--checker`. Without it one line says so.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import quoteattr

from lxml import etree

from scenarios.openscenario import OpenScenarioError, check, scenario_files

CHECKER = "qc_openscenario"


def findings(checker: str, file: Path, folder: Path) -> list[str] | None:
    """Rules of errors that the checker finds in a file, once each; None if it gives no result."""
    configuration, result = folder / "configuration.xml", folder / "result.xqar"
    result.unlink(missing_ok=True)
    configuration.write_text(
        f'<Config><Param name="InputFile" value={quoteattr(str(file))}/>'
        '<CheckerBundle application="xoscBundle">'
        f'<Param name="resultFile" value={quoteattr(str(result))}/></CheckerBundle></Config>',
        encoding="utf-8",
    )
    subprocess.run([checker, "-c", str(configuration)], capture_output=True, check=False, timeout=300)
    if not result.exists():
        return None
    issues = etree.parse(str(result)).iter("Issue")
    rules = [str(issue.get("ruleUID")).rpartition(":")[2] for issue in issues if issue.get("level") == "1"]
    return list(dict.fromkeys(rules))


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table of the files in which the two differ, and how many they agree on."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--roads", type=Path, help="folder with the roads of CARLA's levels")
    parser.add_argument("--checker", default=CHECKER)
    options = parser.parse_args(arguments)
    checker = shutil.which(options.checker)
    if checker is None:
        print(
            f"skipped: no {options.checker}; pip install asam-qc-openscenarioxml in an environment of its own"
        )
        return 0
    try:
        files = scenario_files(options.folder)
    except OpenScenarioError as error:
        print(error, file=sys.stderr)
        return 1
    agreed = 0
    print("| file | ASAM's checker | here |\n| --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        for file in files:
            rules = findings(checker, file, Path(folder))
            held = check(file, options.roads)
            if rules is not None and bool(rules) == (held.verdict == "refused"):
                agreed += 1
                continue
            theirs = "no result" if rules is None else ", ".join(rules) or "no error"
            ours = (
                held.lines[0].replace(f"{options.folder}/", "") if held.verdict == "refused" else held.verdict
            )
            print(f"| {file.relative_to(options.folder)} | {theirs} | {ours} |")
    print(f"\n{len(files)} files, of one verdict {agreed}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
