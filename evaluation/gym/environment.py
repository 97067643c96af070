"""An environment in which an agent decides on the emergency brake, frame by frame."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from evaluation.errors import ArgumentError
from evaluation.gym.observation import OBSERVED, Observation, observation_space, observed
from evaluation.gym.render import Picture
from evaluation.gym.reward import Reward
from evaluation.results.rows import RunRow
from evaluation.runs.execution import row_of
from scenarios.simulation.ends import CUT_OFF
from scenarios.simulation.outcome import Outcome
from scenarios.simulation.simulation import Simulation
from scenarios.sources.frames import Frame, StepResult
from scenarios.sources.perception import Perception
from scenarios.spec import NO_AEB, RunSpec, definition_of, preset_of, simulation_of
from smartmot.pipeline import FrameResult

ACTIONS = ("brake", "deceleration")
FRAMES_PER_S = 20
"""Of the shipped sensor, for films of rendered frames."""


class BrakingEnv(gymnasium.Env[Observation, Any]):  # type: ignore[misc]
    """An episode is a run: the scenario's ego drives as ever, and the agent stands in for the brake rule.

    The shipped perception runs beside it: it gives tracks, area and threats, and whom the ego's speed is
    adapted to where the run has that. What it would do is in `info`: an agent that follows
    `info["emergency"]` gives the outcome of `smartmot-eval`.

    Actions: of `brake` 0 (no) or 1 (an emergency brake with all that the brakes give); of `deceleration` a
    part of that, 0 to 1. A run ends (terminated) as `Outcome.end_reason` says; where the time limit or the
    scenario's own end cuts it off before anything has come of it, it is truncated.

    Args:
        runs: of which an episode is one: drawn with the seed, or `reset(options={"run": number or name})`.
        observe: where objects come from, one of `OBSERVED`; `truth` is for studies of the agent alone.
        objects: most objects in an observation.
        actions: brake or deceleration.
        reward: weights.
        draw_noise: whether each episode draws the seed of the sensor's errors; else it is the run's.
        render_mode: rgb_array, or None.

    Raises:
        ArgumentError: there are no runs, a run has no perception, or an argument is none of its choices.
    """

    metadata: Mapping[str, Any] = {"render_modes": ["rgb_array"], "render_fps": FRAMES_PER_S}

    def __init__(
        self,
        runs: Sequence[RunSpec],
        observe: str = "tracks",
        objects: int = 16,
        actions: str = "brake",
        reward: Reward | None = None,
        draw_noise: bool = False,
        render_mode: str | None = None,
    ) -> None:
        _require(observe, OBSERVED, "observe")
        _require(actions, ACTIONS, "actions")
        if render_mode is not None:
            _require(render_mode, self.metadata["render_modes"], "render_mode")
        if not runs:
            raise ArgumentError("runs: there are none; give at least one")
        if any(run.strategy == NO_AEB for run in runs):
            raise ArgumentError("runs: an agent needs perception; give a strategy, not none")
        if objects < 1:
            raise ArgumentError(f"objects: must be 1 or more, got {objects}")
        self.runs = tuple(runs)
        self.render_mode = render_mode
        self.observation_space = observation_space(objects)
        self.action_space = (
            spaces.Discrete(2) if actions == "brake" else spaces.Box(0.0, 1.0, (1,), np.float32)
        )
        self._observe, self._objects, self._draw_noise = observe, objects, draw_noise
        self._reward = reward or Reward()
        self._run = self.runs[0]
        self._simulation: Simulation | None = None
        self._perception: Perception | None = None
        self._frame: Frame | None = None
        self._result: FrameResult | None = None
        self._observation: Observation | None = None
        self._most_decel_mps2 = 0.0
        self._picture: Picture | None = None

    # What tests and own agents may look at

    @property
    def run(self) -> RunSpec:
        """The run of this episode."""
        return self._run

    @property
    def frame(self) -> Frame | None:
        """What perception knows now; None at the end."""
        return self._frame

    @property
    def result(self) -> FrameResult | None:
        """What the shipped perception makes of it."""
        return self._result

    @property
    def outcome(self) -> Outcome:
        """What the episode has come to.

        Raises:
            scenarios.errors.StepOrderError: it is not at its end.
        """
        return self._running().outcome()

    def row(self) -> RunRow:
        """The episode as a row of `runs.csv`; see `outcome`."""
        return row_of(self._run, self.outcome)

    # Gymnasium

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: of the runs and, with `draw_noise`, of the sensor's errors, from now on.
            options: `run`, number or name (`RunSpec.log`) of a run; `noise_seed`.

        Raises:
            ArgumentError: there is no such run or option.
            ScenarioError: no frame ever comes in the run.
        """
        super().reset(seed=seed)
        given = dict(options or {})
        drawn = int(self.np_random.integers(len(self.runs)))
        noise = int(self.np_random.integers(2**31))
        run = self._chosen(given.pop("run")) if "run" in given else self.runs[drawn]
        noise_seed = given.pop("noise_seed", noise if self._draw_noise else run.seed)
        if given:
            raise ArgumentError(f"reset: unknown option {next(iter(given))!r}; there are: run, noise_seed")
        self._run = replace(run, seed=int(noise_seed))
        self._simulation = simulation_of(self._run)
        self._perception = self._simulation.perception()
        preset = preset_of(self._run, definition_of(self._run))
        self._most_decel_mps2 = preset.brakes.max_decel_mps2
        self._picture = None
        self._take(self._simulation.start())
        if self._observation is None or self._frame is None:
            raise ArgumentError(f"run {self._run.log}: ends before its first frame; leave it out")
        return self._observation, self._info()

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Decide on the present frame, and go on to the next.

        Raises:
            ArgumentError: the action is not in the space, or the episode is over.
        """
        if self._frame is None or self._result is None:
            raise ArgumentError("step: the episode is over, or has not begun; reset() first")
        part = self._part(action)
        asked = self._result.command
        partial = None if part in (0.0, 1.0) else part * self._most_decel_mps2
        command = replace(asked, emergency=part > 0.0, decel_mps2=partial)
        simulation = self._running()
        before_s, before_mps = self._frame.stamp_s, simulation.engine.ego_speed_mps
        simulation.record(replace(self._result, command=command))
        self._take(simulation.step(command))
        ended = self._frame is None
        now_s = self._frame.stamp_s if self._frame is not None else self.outcome.end_time_s
        lost_mps = abs(before_mps) - abs(simulation.engine.ego_speed_mps)
        reward = self._reward.of_braking(lost_mps, now_s - before_s)
        truncated = False
        if ended:
            outcome = self.outcome
            truncated = outcome.end_reason in CUT_OFF
            reward += self._reward.of_end(outcome.impact_speed_mps, self.row().false_activation is True)
        assert self._observation is not None
        return self._observation, reward, ended and not truncated, truncated, self._info()

    def render(self) -> NDArray[np.uint8] | None:
        """The present frame from above, (H, W, 3); None without a render mode.

        Raises:
            ArgumentError: the episode has not begun.
        """
        if self.render_mode is None:
            return None
        if self._observation is None:
            raise ArgumentError("render: the episode has not begun; reset() first")
        simulation = self._running()
        self._picture = self._picture or Picture(simulation.network)
        return self._picture.draw(simulation.ego_box(), simulation.world(), self._result)

    # The episode

    def _running(self) -> Simulation:
        if self._simulation is None:
            raise ArgumentError("the episode has not begun; reset() first")
        return self._simulation

    def _chosen(self, run: object) -> RunSpec:
        if isinstance(run, str):
            for spec in self.runs:
                if spec.log == run:
                    return spec
        elif isinstance(run, int | np.integer) and 0 <= run < len(self.runs):
            return self.runs[int(run)]
        raise ArgumentError(f"reset: no run {run!r}; give 0 to {len(self.runs) - 1}, or the name of its log")

    def _part(self, action: Any) -> float:
        """Part of the brakes' deceleration that an action asks for."""
        if not self.action_space.contains(action):
            raise ArgumentError(f"step: {action!r} is not in {self.action_space}")
        return float(np.asarray(action).reshape(-1)[0])

    def _take(self, step: StepResult) -> None:
        """Go on to a frame, or to the end, where the last observation stays."""
        self._frame, self._result = step.frame, None
        if step.frame is None:
            return
        assert self._perception is not None
        area, ego = self._perception.area(step.frame)
        self._result = self._perception.step(step.frame)
        world = self._running().world()
        self._observation = observed(self._observe, self._result, area, ego, world, self._objects)

    def _info(self) -> dict[str, Any]:
        """Plain values: what the shipped brake rule asks for, and at the end what has come of it."""
        info: dict[str, Any] = {"run": self._run.log, "noise_seed": self._run.seed}
        if self._frame is not None and self._result is not None:
            command = self._result.command
            part = 1.0 if command.decel_mps2 is None else min(command.decel_mps2 / self._most_decel_mps2, 1.0)
            info |= {
                "time_s": self._frame.stamp_s,
                "emergency": bool(command.emergency),
                "deceleration": part if command.emergency else 0.0,
            }
        else:
            row = self.row()
            info |= {
                "time_s": row.end_time_s,
                "end_reason": row.end_reason,
                "collided": row.collided,
                "impact_speed_kmh": row.v_impact_kmh,
                "score": row.score,
                "false_activation": row.false_activation,
            }
        return info


def _require(value: str, choices: Sequence[str], name: str) -> None:
    if value not in choices:
        raise ArgumentError(f"{name}: unknown {value!r}; use one of: {', '.join(choices)}")
