"""What a run came to: contact, requests, stop, and how it ended."""

from __future__ import annotations

import math
import warnings
from dataclasses import asdict, dataclass, fields
from typing import Any

from scenarios.openscenario.running.driving.criteria import Criterion
from scenarios.openscenario.running.results import Contact
from scenarios.simulation.ends import EndReason, is_avoided
from scenarios.simulation.log import RunLog
from smartmot.types import Dropped, FloatArray


@dataclass(frozen=True, slots=True)
class Flag:
    """The first emergency request, or the first warning.

    Args:
        time_s: when.
        distance_m: free distance from the ego's front to the target's box then; None without a target.
        ttc_s: that distance over the speed at which it shrinks; None where it does not.
    """

    time_s: float
    distance_m: float | None
    ttc_s: float | None


@dataclass(slots=True)
class Milestones:
    """What has happened to the ego so far; None where it has not.

    Args:
        flag: the first emergency request.
        warning: the first warning of the driver.
        stop_time_s: when the ego first stood still after a request.
        stop_gap_m: free distance to the target then.
        resumed_s: when it was first let go after that.
    """

    flag: Flag | None = None
    warning: Flag | None = None
    stop_time_s: float | None = None
    stop_gap_m: float | None = None
    resumed_s: float | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Outcome:
    """What a run came to; None where it did not happen.

    Args:
        contact: first contact of the ego with anybody.
        flag_time_s: first emergency request.
        flag_distance_m: free distance from the ego's front to the target's box then.
        flag_ttc_s: that distance over the speed at which it shrinks.
        stop_time_s: when the ego first stood still after a request.
        stop_gap_m: that free distance then.
        target: name of the entity that the test is about.
        target_start_time_s: when it left standstill.
        target_steady_time_s: since when its speed was constant at the contact, or else at the end.
        false_activation: whether a request came before a target that was to set off had done so: then it
            can only have been meant for somebody else. None where the target stands for good, moves from the
            start on, or does not exist.
        end_reason: why the run ended.
        end_time_s: when.
        detections: how many detections the detector reported, dropped ones included.
        dropped: how many of them were dropped, and why.
        notes: lines about what was not as the scenario's file asks for it; see `Engine.notes`.
        log: everything that happened.
        frame_time_ms: (F,) processor time of perception and decision per frame; different in every run.
        warning_time_s: first warning of the driver; rules that do not warn have none.
        warning_ttc_s: as `flag_ttc_s`, at the first warning.
        peak_decel_mps2: greatest deceleration while an emergency brake was requested; 0 without a request.
        added_decel_mps2: greatest deceleration of the emergency brake beyond that of a driver who brakes.
        braking_time_s: when the emergency brake first gave 0.15 g; None: never.
        criteria: what the scenario's file judges the run by, and what came of it.
        struck: touches of traffic (`scenarios.traffic`) that drove into the ego from behind. None of them is
            its contact; who has struck it leaves the run, which goes on as if it had not.
    """

    contact: Contact | None
    flag_time_s: float | None
    flag_distance_m: float | None
    flag_ttc_s: float | None
    stop_time_s: float | None
    stop_gap_m: float | None
    target: str | None
    target_start_time_s: float | None
    target_steady_time_s: float | None
    false_activation: bool | None
    end_reason: EndReason
    end_time_s: float
    detections: int
    dropped: Dropped
    notes: tuple[str, ...]
    log: RunLog
    frame_time_ms: FloatArray
    warning_time_s: float | None = None
    warning_ttc_s: float | None = None
    peak_decel_mps2: float = 0.0
    added_decel_mps2: float = 0.0
    braking_time_s: float | None = None
    criteria: tuple[Criterion, ...] = ()
    struck: tuple[Contact, ...] = ()

    @property
    def warning_lead_s(self) -> float | None:
        """From the first warning to the onset of automatic braking; infinite without that.

        None without a warning: rules that do not warn have none.
        """
        if self.warning_time_s is None:
            return None
        return math.inf if self.braking_time_s is None else self.braking_time_s - self.warning_time_s

    @property
    def avoided(self) -> bool:
        """Whether the run counts as a collision avoided; see `is_avoided`."""
        return is_avoided(self.contact is not None, self.end_reason, self.false_activation)

    @property
    def false_stop(self) -> bool | None:
        """Former name of `false_activation`, until version 0.3."""
        warnings.warn("Outcome.false_stop is false_activation", DeprecationWarning, stacklevel=2)
        return self.false_activation

    @property
    def contact_time_s(self) -> float | None:
        """When the ego first touched anybody."""
        return self.contact.time_s if self.contact else None

    @property
    def impact_speed_mps(self) -> float:
        """How fast the ego was then, forward or in reverse; 0 without contact."""
        return abs(self.contact.ego_speed_mps) if self.contact else 0.0

    @property
    def text(self) -> str:
        """What happened, in a line."""
        parts = []
        if self.contact is None:
            parts.append("no contact")
        else:
            parts.append(
                f"contact with {self.contact.entity} at {self.impact_speed_mps * 3.6:.1f} km/h "
                f"after {self.contact.time_s:.2f} s"
            )
        if self.flag_time_s is None:
            parts.append("no emergency request")
        else:
            false = " (false activation)" if self.false_activation else ""
            gap = "" if self.flag_distance_m is None else f", {self.flag_distance_m:.1f} m before the target"
            parts.append(f"emergency requested at {self.flag_time_s:.2f} s{gap}{false}")
        parts += [
            f"struck from behind by {hit.entity} at {hit.time_s:.2f} s, "
            f"{(hit.entity_speed_mps - hit.ego_speed_mps) * 3.6:.1f} km/h faster"
            for hit in self.struck
        ]
        if self.stop_time_s is not None:
            gap = "" if self.stop_gap_m is None else f", {self.stop_gap_m:.2f} m before the target"
            parts.append(f"stopped at {self.stop_time_s:.2f} s{gap}")
        return f"{'; '.join(parts)}; end at {self.end_time_s:.2f} s ({self.end_reason.value})"

    def to_dict(self) -> dict[str, Any]:
        """All of it but the log and the times per frame, as plain values: what JSON can hold."""
        values = {
            each.name: getattr(self, each.name)
            for each in fields(self)
            if each.name not in ("log", "frame_time_ms")
        }
        return values | {
            "contact": None if self.contact is None else asdict(self.contact),
            "end_reason": self.end_reason.value,
            "dropped": asdict(self.dropped),
            "notes": list(self.notes),
            "criteria": [asdict(criterion) for criterion in self.criteria],
            "struck": [asdict(contact) for contact in self.struck],
            "warning_lead_s": None if self.warning_lead_s == math.inf else self.warning_lead_s,
            "impact_speed_mps": self.impact_speed_mps,
            "avoided": self.avoided,
        }

    def __repr__(self) -> str:
        return f"Outcome({self.text})"
