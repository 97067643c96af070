"""The page: valid, self-contained, small, and safe whatever the files hold."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from evaluation.results.by_speed import comparison_table
from evaluation.results.files import log_path
from evaluation.results.logs import read_log
from evaluation.results.rows import read_runs
from evaluation.runs.folder import read_folder
from evaluation.views.page import charts, page
from evaluation.views.page.codec import unpack
from evaluation.views.page.summary import score_matrix, verdicts

tinyhtml5 = pytest.importorskip("tinyhtml5", reason="tinyhtml5 is not installed: HTML is not checked")
XHTML = "{http://www.w3.org/1999/xhtml}"


@pytest.fixture(scope="module")
def text(folder: Path) -> str:
    """The page without plotly's script, which would take a minute to parse."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(charts, "plotly_script", lambda: "/* plotly */")
        return page.render(page.page_content(read_folder(folder)))


def parsed(text: str) -> Any:
    parser = tinyhtml5.parser.HTMLParser()
    document = parser.parse(text)
    assert parser.errors == []
    return document


def all_of(document: Any, name: str) -> list[Any]:
    return list(document.iter(f"{XHTML}{name}"))


def words(element: Any) -> str:
    return " ".join("".join(element.itertext()).split())


def test_the_page_is_valid_html_with_unique_ids(text: str) -> None:
    document = parsed(text)
    ids = [element.get("id") for element in document.iter() if element.get("id")]
    assert len(ids) == len(set(ids))
    labels = [e.get(a) for e in document.iter() for a in ("aria-labelledby", "aria-describedby") if e.get(a)]
    assert labels
    assert set(labels) <= set(ids)


def test_nothing_is_loaded_from_elsewhere(text: str) -> None:
    document = parsed(text)
    for element in document.iter():
        for attribute in ("src", "href", "action", "data", "poster"):
            assert not (element.get(attribute) or "#").startswith(("http", "//", "file")), element.attrib
    assert "@import" not in text
    assert "default-src 'none'" in text


def test_controls_have_names(text: str) -> None:
    document = parsed(text)
    labelled = {label.get("for") for label in all_of(document, "label")}
    inside = {id(child) for label in all_of(document, "label") for child in label.iter()}
    for name in ("button", "input", "select"):
        for control in all_of(document, name):
            named = control.get("aria-label") or words(control) if name != "select" else None
            assert named or control.get("id") in labelled or id(control) in inside, control.attrib


def test_every_run_has_its_finding_and_can_be_opened(text: str, folder: Path) -> None:
    document = parsed(text)
    runs = read_runs(folder)
    table = next(t for t in all_of(document, "table") if t.get("class") == "runs")
    lines = [words(row) for row in all_of(table, "tr")[1:]]
    assert len(lines) == len(runs)
    hits = runs.loc[runs["collided"], "v_impact_kmh"]
    assert len(hits) > 0
    assert sum("Hits the target pedestrian" in line for line in lines) == len(hits)
    for impact in hits:
        assert any(f"at {impact:.1f} km/h" in line for line in lines)
    options = {option.get("value") for option in all_of(document, "option")}
    assert set(runs["log"]) <= options


def test_the_table_is_that_of_the_comparison(text: str, folder: Path) -> None:
    document = parsed(text)
    table = next(t for t in all_of(document, "table") if t.get("class") == "numbers")
    wanted = comparison_table(read_runs(folder))
    assert [words(cell) for cell in all_of(table, "th")] == list(wanted.header)
    cells = [words(cell) for cell in all_of(table, "td")]
    assert cells == [cell for row in (*wanted.rows, *wanted.totals) for cell in row]


def test_published_values_stand_beside_those_of_the_papers_conditions(
    tmp_path: Path, command: Callable[..., int]
) -> None:
    assert command("cpna", "--speeds", "60", "--no-pictures", "--quiet", "--out", tmp_path) == 0
    table = page.page_content(read_folder(tmp_path)).table
    assert "published (km/h)" in table.header
    # table I of the SmartMOT paper: 44.23 km/h with the rectangle, none with the map
    assert [cell for name, cell in zip(table.header, table.rows[0], strict=True) if "publ" in name] == [
        "44.23",
        "0.00",
    ]


def test_texts_of_files_are_escaped(folder: Path, tmp_path: Path) -> None:
    evil = """</script><img src=x onerror="alert('1')"><b>&amp;"""
    copy = tmp_path / "evil"
    shutil.copytree(folder, copy)
    runs = pd.read_csv(copy / "runs.csv")
    runs["scenario"] = runs["strategy"] = evil
    runs["log"] = [f"log{index}" for index in range(len(runs))]
    for name in runs["log"]:
        shutil.copy(next((copy / "logs").glob("CPNA*")), copy / "logs" / f"{name}.parquet")
    log = read_log(copy / "logs" / "log0.parquet")
    texts = {"label": evil, "category": evil}
    events = log["kind"] == "event"
    log.loc[events, "label"] = evil
    log.loc[log["kind"] == "track", list(texts)] = evil
    log.to_parquet(copy / "logs" / "log0.parquet")
    runs.to_csv(copy / "runs.csv", index=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(charts, "plotly_script", lambda: "")
        text = page.render(page.page_content(read_folder(copy)))
    document = parsed(text)
    assert all_of(document, "img") == []
    assert not any(element.get("onerror") for element in document.iter())
    assert evil in words(all_of(document, "h1")[0])


def test_sixty_runs_stay_under_ten_megabytes(folder: Path, tmp_path: Path) -> None:
    """With bystanders, and each run of full length: what a suite of 60 runs takes."""
    copy = tmp_path / "sixty"
    (copy / "logs").mkdir(parents=True)
    shutil.copy(folder / "runs.json", copy / "runs.json")
    runs = read_runs(folder)
    many = []
    for seed in range(15):
        again = runs.assign(seed=seed, log=[f"{name}-{seed}" for name in runs["log"]])
        for old, new in zip(runs["log"], again["log"], strict=True):
            shutil.copy(log_path(folder, old), log_path(copy, new))
        many.append(again)
    pd.concat(many).to_csv(copy / "runs.csv", index=False)
    written, (note,) = page.write_page(copy)
    assert note.endswith("runs.json does not have them; run the test again")
    assert len(re.findall(r'id="run-\d+"', written.read_text())) == 60
    assert written.stat().st_size < 10e6


def test_a_folder_whose_configuration_is_unknown_still_gets_a_page(folder: Path, tmp_path: Path) -> None:
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    (copy / "runs.json").write_text('{"version": "9", "configuration": {}}')
    content = page.page_content(read_folder(copy))
    assert content.packed_maps == []
    assert len(content.notes) == 1
    assert "Lanes and monitored areas are not drawn" in content.notes[0]
    assert len(content.runs) == 4


def test_runs_without_scenario_and_map_get_a_page(folder: Path, tmp_path: Path) -> None:
    """As of a recorded drive: a table of runs and logs, and nothing that says how they were set up."""
    for file in ("runs.csv", *(f"logs/{path.name}" for path in (folder / "logs").iterdir())):
        (tmp_path / file).parent.mkdir(exist_ok=True)
        shutil.copy(folder / file, tmp_path / file)
    content = page.page_content(read_folder(tmp_path))
    assert len(content.runs) == 4
    assert {view.map_index for view in content.runs} == {-1}
    assert content.packed_maps == []
    packed = unpack(content.runs[0].packed)
    assert packed["roles"] == []
    assert set(packed["objects"]["track"]["labels"]) <= {"static", "dynamic", "threat"}
    assert "Map" not in content.facts


def test_matrix_and_verdicts_count_outcomes(folder: Path) -> None:
    content = page.page_content(read_folder(folder))
    runs = read_runs(folder)
    accounts = {view.log: view.account for view in content.runs}
    matrix = score_matrix(runs, accounts)
    assert matrix.columns == ["30", "60"]
    for name, cells in matrix.lines:
        for speed, cell in zip((30.0, 60.0), cells, strict=True):
            run = runs[(runs["strategy"] == name) & (runs["v_test_kmh"] == speed)].iloc[0]
            assert cell is not None
            assert cell.log == run["log"]
            assert cell.score == f"{run['score']:.2f} of {run['score_max']:g}"
            assert (cell.mark == "◐") == run["collided"]
    titles = {view.log: view.title for view in content.runs}
    found = {verdict.strategy: verdict for verdict in verdicts(runs, accounts, titles)}
    assert found["rectangular"].headline == (
        "Collision in 1 of 2 runs (at 60 km/h), mitigated; no false activation in 2 runs."
    )
    assert found["map"].headline == "No collision in 2 runs; no false activation in 2 runs."
    assert found["map"].reasons == ()
    assert [reason.title for reason in found["rectangular"].reasons] == [
        "Why the collision (rectangular, 60 km/h)"
    ]


def test_the_first_run_shown_is_a_failure(folder: Path) -> None:
    content = page.page_content(read_folder(folder))
    assert content.runs[content.first].account.kind == "mitigated"


def test_curves_end_at_stop_or_contact(folder: Path) -> None:
    results_folder = read_folder(folder)
    runs = results_folder.runs
    logs = {str(name): results_folder.log(str(name)) for name in runs["log"]}
    panels = charts.speed_specs(runs, logs)
    assert len(panels) == 2
    for _, spec in panels:
        for curve in (trace for trace in spec["data"] if trace["mode"] == "lines"):
            run = runs[runs["log"] == curve["meta"]].iloc[0]
            assert curve["x"][-1] == 0.0
            assert curve["y"][-1] == pytest.approx(run["v_impact_kmh"], abs=0.006)
            assert np.all(np.diff(curve["x"]) > 0)


def test_figures_are_valid_for_plotly(folder: Path) -> None:
    """The library knows every name and value that plotly.js does, and refuses others."""
    from plotly.graph_objects import Figure

    content = page.page_content(read_folder(folder))
    specs = [spec for _, spec in content.panels]
    specs += [unpack(view.packed)["diagram"] for view in content.runs]
    assert len(specs) == 6
    for spec in specs:
        assert len(Figure(spec).data) == len(spec["data"]) > 0
    with pytest.raises(ValueError, match="heigth"):
        Figure({"layout": {"heigth": 3}})


def test_the_diagram_shows_the_events_of_the_log(folder: Path) -> None:
    results_folder = read_folder(folder)
    content = page.page_content(results_folder)
    for view in content.runs:
        log = results_folder.log(view.log)
        events = log[log["kind"] == "event"]
        trace = next(t for t in unpack(view.packed)["diagram"]["data"] if t.get("name") == "events")
        shown = events["label"].replace("collision", "collision predicted")
        assert trace["hovertext"] == trace["text"] == shown.tolist()
        assert (events["label"] == "collision").any()
        assert trace["x"] == pytest.approx(events["time_s"].tolist(), abs=0.0006)
