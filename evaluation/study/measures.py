"""One run of a comparison, and what is measured in it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from evaluation.protocols.bands import impact_colour
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.paper import paper_score
from evaluation.runs import FrameTime, frame_time, preset_of, simulation_of
from evaluation.settings import settings_text
from evaluation.study.criticality import criticality
from evaluation.study.grid import StudyRun
from scenarios.simulation import StopRule

THROUGH = StopRule(time_limit_s=60.0, after_resume_s=math.inf, after_pass_m=math.inf)
"""A scene in which nothing should happen is driven to its end, so that the delay can be measured."""
STANDING_MPS = 0.1


@dataclass(frozen=True, slots=True)
class RunMeasures:
    """What one run came to; None where it did not happen or has no meaning.

    Args:
        scene, variant, must: the scene.
        strategy, settings, preset, weather, seed: who decided, and in which conditions.
        v_test_kmh: speed of the ego.
        collided: whether the ego touched anybody.
        v_impact_kmh: its speed then, 0 without contact.
        score: the paper's points, of scenes that ask for braking.
        band: colour of the impact speed by Euro NCAP 2026, of those; None where it has none for the speed.
        flag_time_s: first emergency request.
        flag_distance_m: free distance to the target then.
        flag_ttc_s: time to collision with anybody then, from ground truth at constant velocities; None also
            where nobody was on a collision course.
        false_stop: an emergency request where nothing should happen.
        needless_stop: a false stop, or a standstill where nothing should happen: adapting the speed to
            somebody who is in nobody's way can end in a standstill without an emergency.
        speed_loss_kmh: by how much it was slower at the slowest than without braking.
        delay_s: how much later it was where it came to than without braking.
        distance_m: driven.
        duration_s: of the run.
        detections_mean, tracks_mean: per frame.
        min_ttc_s: shortest time to collision; None: nobody was ever on a collision course.
        max_btn: greatest brake threat number before a contact.
    """

    scene: str
    variant: str
    must: str
    strategy: str
    settings: str
    preset: str
    weather: str
    seed: int
    v_test_kmh: float
    collided: bool
    v_impact_kmh: float
    score: float | None
    band: str | None
    flag_time_s: float | None
    flag_distance_m: float | None
    flag_ttc_s: float | None
    false_stop: bool
    needless_stop: bool
    speed_loss_kmh: float
    delay_s: float
    distance_m: float
    duration_s: float
    detections_mean: float
    tracks_mean: float
    min_ttc_s: float | None
    max_btn: float


def measure(run: StudyRun) -> tuple[RunMeasures, FrameTime]:
    """Carry out one run.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the scene cannot be run.
        opendrive.OpenDriveError: its map cannot be read.
    """
    spec, nothing = run.spec, run.scene.must == "nothing"
    simulation = simulation_of(spec, THROUGH if nothing else None)
    brakes = preset_of(spec, simulation.engine.definition).brakes
    outcome = simulation.run()
    log = outcome.log.table()
    own = np.flatnonzero(log["kind"] == "ego")
    time_s, speed = log["time_s"][own], log["speed_mps"][own]
    driven = float(np.hypot(np.diff(log["x_m"][own]), np.diff(log["y_m"][own])).sum())
    duration = float(time_s[-1] - time_s[0])
    threat = criticality(log, brakes.max_decel_mps2)
    flagged, flag_ttc = outcome.flag_time_s is not None, None
    if outcome.flag_time_s is not None:
        at = min(int(np.searchsorted(threat.time_s, outcome.flag_time_s)), len(threat.time_s) - 1)
        flag_ttc = _finite(float(threat.time_to_collision_s[at]))
    before = threat.brake_threat_number[np.isfinite(threat.brake_threat_number)]
    spent = frame_time(outcome.frame_time_ms)
    frames = max(spent.frames, 1)
    impact = outcome.impact_speed_mps * 3.6
    measures = RunMeasures(
        scene=run.scene.scene,
        variant=run.scene.variant,
        must=run.scene.must,
        strategy=spec.strategy,
        settings=settings_text(spec.settings),
        preset=spec.preset,
        weather=spec.weather,
        seed=spec.seed,
        v_test_kmh=spec.v_test_kmh,
        collided=outcome.contact is not None,
        v_impact_kmh=impact,
        score=None if nothing else paper_score(spec.v_test_kmh, impact),
        band=None if nothing else _band(spec.v_test_kmh, impact),
        flag_time_s=outcome.flag_time_s,
        flag_distance_m=outcome.flag_distance_m,
        flag_ttc_s=flag_ttc,
        false_stop=nothing and flagged,
        needless_stop=nothing and (flagged or float(speed.min()) < STANDING_MPS),
        speed_loss_kmh=3.6 * float(speed[0] - speed.min()),
        delay_s=duration - driven / float(speed[0]),
        distance_m=driven,
        duration_s=duration,
        detections_mean=float(np.count_nonzero(log["kind"] == "detection")) / frames,
        tracks_mean=float(np.count_nonzero(log["kind"] == "track")) / frames,
        min_ttc_s=_finite(float(threat.time_to_collision_s.min())),
        max_btn=float(before.max(initial=0.0)),
    )
    return measures, spent


def _band(v_test_kmh: float, v_impact_kmh: float) -> str | None:
    try:
        return impact_colour(v_test_kmh, v_impact_kmh).value
    except ProtocolError:
        return None


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
