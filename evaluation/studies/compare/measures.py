"""One run of a comparison, and what is measured in it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evaluation.metrics.criticality import criticality
from evaluation.protocols.bands import Colour, impact_colour
from evaluation.protocols.errors import ProtocolError
from evaluation.results.notes import MANY_DROPPED
from evaluation.runs.execution import FrameTime, frame_time, impact_speed_kmh, run_points
from evaluation.studies.compare.grid import SceneItem
from scenarios.settings import settings_text
from scenarios.simulation.ends import CUT_OFF, THROUGH, TIME_LIMIT_S, EndReason, is_avoided
from scenarios.simulation.outcome import Outcome
from scenarios.spec import preset_of, simulation_of
from smartmot.decision.rules import STANDING_MPS
from smartmot.types import FloatArray


@dataclass(frozen=True, slots=True)
class RunMeasures:
    """What one run came to; None where it did not happen or has no meaning.

    Args:
        scene, variant, must: the scene.
        strategy, settings, preset, weather, seed: who decided, and in which conditions.
        v_test_kmh: speed of the ego.
        collided: whether the ego touched anybody.
        v_impact_kmh: its speed then, 0 without contact; None of a run that the time limit cut off.
        score: the paper's points, of scenes that ask for braking.
        band: colour of the impact speed by Euro NCAP 2026, of those; None where it has none for the speed.
        flag_time_s: first emergency request.
        flag_distance_m: free distance to the target then.
        flag_ttc_s: time to collision with anybody then, from ground truth at constant velocities; None also
            where no road user was on a collision course.
        end_reason: why the run ended, see `scenarios.simulation.ends.EndReason`.
        false_activation: an emergency request where nothing should happen, or before a target that was to set
            off had done so; None where the ego must brake for one that stands or moves from the start.
        needless_stop: a false activation, or a standstill where nothing should happen: adapting the speed to
            an object that is not in the way can end in a standstill without an emergency.
        speed_loss_kmh: by how much it was slower at the slowest than without braking.
        delay_s: how much later it was where it came to than without braking.
        distance_m: driven.
        duration_s: of the run.
        detections_mean, tracks_mean: per frame.
        dropped_share: of the detections, for their score, category or box.
        min_ttc_s: shortest time to collision; None: there was never a collision course.
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
    v_impact_kmh: float | None
    score: float | None
    band: str | None
    flag_time_s: float | None
    flag_distance_m: float | None
    flag_ttc_s: float | None
    end_reason: str
    false_activation: bool | None
    needless_stop: bool
    speed_loss_kmh: float
    delay_s: float
    distance_m: float
    duration_s: float
    detections_mean: float
    tracks_mean: float
    dropped_share: float
    min_ttc_s: float | None
    max_btn: float

    @property
    def avoided(self) -> bool:
        """Whether the run counts as a collision avoided; see `scenarios.simulation.ends.is_avoided`."""
        return is_avoided(self.collided, self.end_reason, self.false_activation)

    @property
    def cut_off(self) -> bool:
        """Whether it ended before what was to come: it is in no share.

        An unnecessary stop has come, whatever else would have.
        """
        return self.end_reason in CUT_OFF and not self.needless_stop


def told_measures(runs: Sequence[RunMeasures]) -> list[str]:
    """What the reader has to know about finished runs, one line each; none if all is as it should be."""
    ends = [run.end_reason for run in runs if run.cut_off]
    ended, not_begun = ends.count(EndReason.TIME_LIMIT), ends.count(EndReason.NOT_BEGUN)
    lost = [run.dropped_share for run in runs if run.dropped_share > MANY_DROPPED]
    lines = []
    if ended:
        lines.append(f"{ended} of {len(runs)} runs were cut off at {TIME_LIMIT_S:g} s, and are in no rate")
    if not_begun:
        lines.append(
            f"{not_begun} of {len(runs)} runs were ended by the scenario's stop trigger before any event of "
            "the target began, and are in no rate"
        )
    if lost:
        lines.append(
            f"in {len(lost)} of {len(runs)} runs more than a tenth of the detections were dropped "
            f"(up to {100 * max(lost):.0f} %), for their score, category or box; `runs.csv` has the shares"
        )
    return lines


def false_activation_of(must: str, outcome: Outcome) -> bool | None:
    """Whether a request was one for nothing: any where nothing should happen; see `Outcome` else."""
    return outcome.flag_time_s is not None if must == "nothing" else outcome.false_activation


def is_unnecessary_stop(must: str, outcome: Outcome, speed_mps: FloatArray) -> bool:
    """Whether the ego made an emergency request, or stood, where nothing should happen.

    Args:
        must: what the ego must do, brake or nothing.
        outcome: of the run.
        speed_mps: (F,) of the ego.
    """
    return must == "nothing" and (outcome.flag_time_s is not None or float(speed_mps.min()) < STANDING_MPS)


def impact_kmh(run: RunMeasures) -> float | None:
    """Impact speed for means, 0 for a collision avoided; None of a run that tells nothing about it."""
    return run.v_impact_kmh if run.collided or run.avoided else None


def measure(item: SceneItem) -> tuple[RunMeasures, FrameTime]:
    """Carry out one run.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the scene cannot be run.
        opendrive.OpenDriveError: its map cannot be read.
    """
    spec, scene = item.spec, item.label
    nothing = scene.must == "nothing"
    simulation = simulation_of(spec, THROUGH if nothing else None)
    brakes = preset_of(spec, simulation.engine.definition).brakes
    outcome = simulation.run()
    log = outcome.log.table()
    own = np.flatnonzero(log["kind"] == "ego")
    time_s, speed = log["time_s"][own], log["speed_mps"][own]
    driven = float(np.hypot(np.diff(log["x_m"][own]), np.diff(log["y_m"][own])).sum())
    duration = float(time_s[-1] - time_s[0])
    threat = criticality(log, brakes.max_decel_mps2)
    flag_ttc = None
    if outcome.flag_time_s is not None:
        at = min(int(np.searchsorted(threat.time_s, outcome.flag_time_s)), len(threat.time_s) - 1)
        flag_ttc = _finite(float(threat.time_to_collision_s[at]))
    before = threat.brake_threat_number[np.isfinite(threat.brake_threat_number)]
    spent = frame_time(outcome.frame_time_ms)
    frames = max(spent.frames, 1)
    measures = RunMeasures(
        scene=scene.scene,
        variant=scene.variant,
        must=scene.must,
        strategy=spec.strategy,
        settings=settings_text(spec.settings),
        preset=spec.preset,
        weather=spec.weather,
        seed=spec.seed,
        v_test_kmh=spec.v_test_kmh,
        collided=outcome.contact is not None,
        v_impact_kmh=impact_speed_kmh(outcome),
        score=None if nothing else run_points(outcome, spec.v_test_kmh),
        band=None if nothing else _band(outcome, spec.v_test_kmh),
        flag_time_s=outcome.flag_time_s,
        flag_distance_m=outcome.flag_distance_m,
        flag_ttc_s=flag_ttc,
        end_reason=outcome.end_reason.value,
        false_activation=false_activation_of(scene.must, outcome),
        needless_stop=is_unnecessary_stop(scene.must, outcome, speed),
        speed_loss_kmh=3.6 * float(speed[0] - speed.min()),
        delay_s=duration - driven / float(speed[0]),
        distance_m=driven,
        duration_s=duration,
        detections_mean=float(np.count_nonzero(log["kind"] == "detection")) / frames,
        tracks_mean=float(np.count_nonzero(log["kind"] == "track")) / frames,
        dropped_share=outcome.dropped.total / max(outcome.detections, 1),
        min_ttc_s=_finite(float(threat.time_to_collision_s.min())),
        max_btn=float(before.max(initial=0.0)),
    )
    return measures, spent


def _band(outcome: Outcome, v_test_kmh: float) -> str | None:
    """Colour of the impact speed; of braking before the target has set off the worst."""
    if outcome.end_reason in CUT_OFF:
        return None
    try:
        colour = impact_colour(v_test_kmh, outcome.impact_speed_mps * 3.6)
    except ProtocolError:
        return None
    return (Colour.RED if outcome.false_activation else colour).value


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
