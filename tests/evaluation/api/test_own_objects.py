"""Trackers, rules, areas and detectors of the user's own as objects in Python."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import smartmot
from evaluation.errors import ArgumentError
from scenarios.places import MapView
from scenarios.presets import Preset
from scenarios.sensors import Sensor
from smartmot.errors import PluginError
from smartmot.plugins import is_of_process, name_for, plugin, source_digest

CPNA: dict[str, Any] = {"scenario": "cpna", "speed_kmh": 40}


class Ours:
    """The shipped tracker behind the interface of an own one; it remembers."""

    def __init__(self) -> None:
        self.tracker = smartmot.Tracker()
        self.frames = 0

    def update(self, detections: smartmot.Detections) -> smartmot.Tracks:
        self.frames += 1
        return self.tracker.update(detections)


class Blind(Sensor):
    """Sees nobody."""

    def observe(self, frame: Any, ego: Any, boxes: Any, category: Any, there: Any = None) -> Any:
        return smartmot.Detections.empty(ego.stamp_s)


@dataclass
class Always:
    """Brakes from a time on."""

    from_s: float

    def decide(self, state: Any, now: smartmot.Assessment) -> Any:
        braking = now.ego.stamp_s >= self.from_s - 1e-9
        events = [smartmot.Event(now.ego.stamp_s, "monitors", "collision")] if braking and not state else []
        return braking, smartmot.Command(braking), events


def corridor(view: MapView, preset: Preset) -> smartmot.MapArea:
    """The shipped map strategy under another name."""
    return smartmot.MapArea(view.network, view.route, preset.map_area)


def test_a_class_and_an_object_do_what_the_shipped_tracker_does() -> None:
    shipped = smartmot.run(**CPNA).to_dict()
    kept = Ours()
    for tracker in (Ours, kept, lambda: Ours()):
        assert smartmot.run(**CPNA, tracker=tracker).to_dict()["outcome"] == shipped["outcome"]
    assert kept.frames == 0  # runs have copies


def test_each_run_of_a_sweep_has_a_copy_of_its_own() -> None:
    results = smartmot.sweep("cpna", speed_kmh=(40, 50), strategy="map", tracker=Ours())
    shipped = smartmot.sweep("cpna", speed_kmh=(40, 50), strategy="map", workers=1)
    columns = ["v_test_kmh", "v_impact_kmh", "flag_time_s", "stop_gap_m"]
    assert results.frame()[columns].equals(shipped.frame()[columns])


def test_a_rule_brakes_when_it_says() -> None:
    single = smartmot.run(**CPNA, rule=Always(1.5))
    assert single.outcome.flag_time_s == pytest.approx(1.5)
    assert single.outcome.false_activation  # before the pedestrian has set off
    assert "false activation" in repr(single)


def test_areas_are_functions_or_objects() -> None:
    shipped = smartmot.run(**CPNA, strategy="map").outcome
    assert smartmot.run(**CPNA, strategy=corridor).outcome.to_dict() == shipped.to_dict()
    everything = smartmot.run(**CPNA, strategy=smartmot.EverythingArea())
    assert everything.outcome.to_dict() == smartmot.run(**CPNA, strategy="all").outcome.to_dict()
    assert everything.row.strategy == "object:EverythingArea"


def test_a_detector_that_sees_nobody() -> None:
    single = smartmot.run(**CPNA, detector=Blind)
    assert single.outcome.flag_time_s is None
    assert single.outcome.impact_speed_mps == pytest.approx(40 / 3.6)


def test_objects_of_a_comparison_stand_beside_the_shipped_ones() -> None:
    results = smartmot.compare(
        "map", vary={"tracker": ("preset", Ours())}, scenes="walking along", seeds=1, logs=False
    )
    assert results.frame("table")["settings"].str.contains("tracker=object:Ours").sum() == 1
    first, second = (rows.reset_index() for _, rows in results.frame().groupby("settings"))
    assert len(first) == len(second) > 0
    assert first["false_activation"].tolist() == second["false_activation"].tolist()


def test_what_can_be_imported_has_the_name_of_the_command_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "my_importable.py").write_text(
        "import smartmot\n\n\ndef mine():\n    return smartmot.Tracker()\n"
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    import my_importable  # type: ignore[import-not-found]

    assert name_for(my_importable.mine, "update") == "my_importable:mine"
    assert smartmot.run(**CPNA, tracker=my_importable.mine).spec.settings == (
        ("tracker", "my_importable:mine"),
    )


def test_names_of_objects_of_this_process() -> None:
    """Each object has one, which no other process knows; the same class the same."""

    class Local(Ours):
        """No other process can import it."""

    first, again, other = (name_for(given, "update") for given in (Local, Local, Local()))
    assert first == again != other
    assert is_of_process(first)
    assert is_of_process(other)
    assert plugin(first).digest == source_digest(first) != source_digest(other)
    with pytest.raises(PluginError, match="object:Gone: an object of the Python process that made the run"):
        plugin("object:Gone")


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"tracker": 3}, "tracker: unknown 3.0"),
        ({"tracker": object()}, r"neither a class or function, nor an object with update\(\)"),
        ({"strategy": []}, r"neither a class or function, nor an object with at\(\)"),
        ({"rule": lambda: 3}, r"object:lambda.* made int, which has no decide\(\)"),
    ],
)
def test_what_is_no_object_is_refused(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        smartmot.run(**CPNA, **given)


def test_objects_of_this_process_are_not_given_to_others() -> None:
    with pytest.raises(ArgumentError, match=r"workers: object:Ours.* is an object of this process, which 2"):
        smartmot.sweep("cpna", tracker=Ours(), workers=2)


def test_a_script_without_a_guard_may_use_several_processes(tmp_path: Path) -> None:
    """It is not run again in each of them, as `multiprocessing` does with scripts."""
    script = tmp_path / "script.py"
    script.write_text(
        "import smartmot\n"
        "print('begins')\n"
        "rows = smartmot.sweep('cpna', speed_kmh=(20, 30, 40), strategy='map', workers=2).frame()\n"
        "print(rows['v_impact_kmh'].tolist())\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, check=False)
    assert done.stdout.splitlines() == ["begins", "[0.0, 0.0, 0.0]"], done.stderr
