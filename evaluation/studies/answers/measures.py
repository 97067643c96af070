"""What is kept of a run that answers a question."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from evaluation.runs.execution import FrameTime, frame_time, impact_speed_kmh
from evaluation.studies.answers.arms import ArmRun
from evaluation.studies.compare.measures import false_activation_of, is_unnecessary_stop
from scenarios.simulation.ends import CUT_OFF, THROUGH, is_avoided
from scenarios.simulation.outcome import Outcome
from scenarios.simulation.simulation import Simulation
from scenarios.spec import simulation_of


@dataclass(frozen=True, slots=True)
class Decision:
    """What a run came to; None where it did not happen or has no meaning.

    Args:
        collided: whether the ego touched any road user.
        v_impact_kmh: its speed then, 0 without contact; None of a run that was cut off.
        false_activation: an emergency request where nothing should happen, or before a target that was to set
            off had done so; None where the ego must brake for one that stands or moves from the start.
        unnecessary_stop: a request or a standstill where nothing should happen.
        flag_ttc_s: time to collision with the target at the first emergency request.
        warning_ttc_s: the same at the first warning of the driver; rules that do not warn have none.
        speed_lost_kmh: by how much it was slower at the slowest than at the start.
        peak_decel_mps2: its greatest deceleration.
        end_reason: why the run ended, see `scenarios.simulation.ends.EndReason`.
    """

    collided: bool
    v_impact_kmh: float | None
    false_activation: bool | None
    unnecessary_stop: bool
    flag_ttc_s: float | None
    warning_ttc_s: float | None
    speed_lost_kmh: float
    peak_decel_mps2: float
    end_reason: str

    @property
    def avoided(self) -> bool:
        """Whether it counts as a collision avoided: not after a request before the target had set off."""
        return is_avoided(self.collided, self.end_reason, self.false_activation)

    @property
    def cut_off(self) -> bool:
        """Whether it ended before what was to come: it is in no rate.

        An unnecessary stop has come, whatever else would have.
        """
        return self.end_reason in CUT_OFF and not self.unnecessary_stop


def decide(item: ArmRun) -> tuple[Decision, FrameTime]:
    """Carry out one run.

    Raises:
        scenarios.openscenario.errors.OpenScenarioError: the scene cannot be run.
        opendrive.OpenDriveError: its map cannot be read.
    """
    decision, outcome, _ = decided(item)
    return decision, frame_time(outcome.frame_time_ms)


def decided(item: ArmRun) -> tuple[Decision, Outcome, Simulation]:
    """A run that is carried out; see `decide`."""
    must = item.spec.must
    simulation = simulation_of(item.spec, THROUGH if must == "nothing" else None)
    outcome = simulation.run()
    log = outcome.log.table()
    ego = log["kind"] == "ego"
    speed = log["speed_mps"][ego]
    decision = Decision(
        collided=outcome.contact is not None,
        v_impact_kmh=impact_speed_kmh(outcome),
        false_activation=false_activation_of(must, outcome),
        unnecessary_stop=is_unnecessary_stop(must, outcome, speed),
        flag_ttc_s=outcome.flag_ttc_s,
        warning_ttc_s=outcome.warning_ttc_s,
        speed_lost_kmh=3.6 * float(speed[0] - speed.min()),
        peak_decel_mps2=max(0.0, -float(log["accel_mps2"][ego].min())),
        end_reason=outcome.end_reason.value,
    )
    return decision, outcome, simulation


@dataclass(frozen=True, slots=True)
class Measure:
    """What of a run is compared.

    Args:
        text: in words.
        must: kind of scenes in which it is measured.
        value: of a run; None where it has none.
        unit: of its values; empty: it is so or not.
        digits: that are printed.
        partial: whether only some of the runs have a value; then it is told by its median.
    """

    text: str
    must: str
    value: Callable[[Decision], float | None]
    unit: str = ""
    digits: int = 0
    partial: bool = False


def _impact_kmh(run: Decision) -> float | None:
    """Impact speed, 0 of a collision avoided; none of a run that never met its target."""
    return run.v_impact_kmh if run.collided or run.avoided else None


def _timely(run: Decision, value: float | None) -> float | None:
    """A value of a run whose request was not for something else."""
    return None if run.false_activation else value


MEASURES: Mapping[str, Measure] = MappingProxyType(
    {
        "avoided": Measure("collisions avoided", "brake", lambda run: run.avoided),
        "stops": Measure("unnecessary stops", "nothing", lambda run: run.unnecessary_stop),
        "early": Measure("early activations", "brake", lambda run: run.false_activation),
        "impact": Measure("impact speed", "brake", _impact_kmh, "km/h", 1),
        "flag_ttc": Measure(
            "TTC at the request", "brake", lambda run: _timely(run, run.flag_ttc_s), "s", 2, partial=True
        ),
        "warning_ttc": Measure(
            "TTC at the warning", "brake", lambda run: _timely(run, run.warning_ttc_s), "s", 2, partial=True
        ),
        "speed_lost": Measure("speed lost", "nothing", lambda run: run.speed_lost_kmh, "km/h", 1),
        "peak_decel": Measure("peak deceleration", "nothing", lambda run: run.peak_decel_mps2, "m/s²", 1),
    }
)
"""By short names; the first two are what questions are decided by."""

DECISIVE = ("avoided", "stops")
