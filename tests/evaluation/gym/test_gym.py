"""Tests for the environments: their episodes are runs of the command line, in the forms of Gymnasium."""

from __future__ import annotations

import copy
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env, data_equivalence

from evaluation.errors import ArgumentError
from evaluation.gym import OBJECT_COLUMNS, BrakingEnv, Reward
from evaluation.gym.registered import cpna as cpna_env
from evaluation.results.rows import RunRow
from evaluation.runs.execution import execute
from smartmot.types import CATEGORIES


def cpna(**options: Any) -> BrakingEnv:
    environment = gymnasium.make("smartmot/CPNA-v0", **options).unwrapped
    assert isinstance(environment, BrakingEnv)
    return environment


def scenario(name: str, **parameters: float) -> BrakingEnv:
    environment = gymnasium.make("smartmot/Scenario-v0", scenario=name, parameters=parameters).unwrapped
    assert isinstance(environment, BrakingEnv)
    return environment


def shipped(environment: BrakingEnv, run: int | str) -> RunRow:
    """The row of an episode whose agent does what the shipped rule asks for."""
    _, info = environment.reset(options={"run": run})
    ended = False
    while not ended:
        action: Any = int(info["emergency"])
        if isinstance(environment.action_space, gymnasium.spaces.Box):
            action = np.array([info["deceleration"]], np.float32)
        *_, terminated, truncated, info = environment.step(action)
        ended = terminated or truncated
    return environment.row()


def test_an_agent_that_follows_the_shipped_rule_gives_the_rows_of_cpna() -> None:
    by_kind = [cpna(actions=actions) for actions in ("brake", "deceleration")]
    runs = by_kind[0].runs
    assert len(runs) == 12
    assert by_kind[1].runs == runs
    for k, spec in enumerate(runs):
        row = execute(spec, keep_log=False).row
        assert [shipped(environment, k) for environment in by_kind] == [row, row]


def test_runs_of_a_scenario_and_of_the_scenes_are_those_of_the_command_line() -> None:
    for environment in (
        gymnasium.make(
            "smartmot/Scenario-v0", scenario="crossing", parameters={"Ego_speed_kmh": 40}
        ).unwrapped,
        gymnasium.make("smartmot/Scenes-v0", names=["people at the kerb"]).unwrapped,
    ):
        assert isinstance(environment, BrakingEnv)
        spec = environment.runs[-1]
        assert shipped(environment, spec.log) == execute(spec, keep_log=False).row


@pytest.mark.parametrize("observe", ["tracks", "detections", "truth"])
@pytest.mark.parametrize("actions", ["brake", "deceleration"])
def test_it_is_as_gymnasium_wants_it(observe: str, actions: str) -> None:
    environment = cpna(speeds_kmh=(50.0,), observe=observe, actions=actions, render_mode="rgb_array")
    check_env(environment)


def test_vectors_of_environments_step_together() -> None:
    vector = gymnasium.make_vec("smartmot/CPNA-v0", 3, "sync", speeds_kmh=(40.0,))
    observation, _ = vector.reset(seed=1)
    assert observation["objects"].shape == (3, 16, len(OBJECT_COLUMNS))
    for _ in range(300):
        _, reward, terminated, truncated, _ = vector.step(np.zeros(3, np.int64))
        if terminated.any():
            break
    # nobody brakes: contact, whose cost is that of the speed
    assert terminated.all()
    assert not truncated.any()
    np.testing.assert_allclose(reward, -10.0 * (40.0 / 3.6 / 10.0) ** 2, rtol=0.05)


def test_equal_seeds_give_equal_episodes() -> None:
    def episode(seed: int) -> list[Any]:
        environment = cpna(draw_noise=True, preset="real", speeds_kmh=(30.0, 40.0))
        held: list[Any] = [environment.reset(seed=seed)]
        held += [environment.step(0) for _ in range(5)]
        held.append(environment.reset())
        return held

    assert data_equivalence(episode(3), episode(3))
    assert not data_equivalence(episode(3), episode(4))


def test_a_copy_goes_on_for_itself() -> None:
    environment = cpna(speeds_kmh=(40.0,))
    environment.reset(options={"run": 0})
    for _ in range(20):
        environment.step(0)
    other = copy.deepcopy(environment)
    assert data_equivalence(environment.step(1), other.step(1))


def test_objects_are_in_the_axes_of_the_ego_and_the_nearest_come_first() -> None:
    environment = cpna(speeds_kmh=(40.0,), strategies=("map",), observe="truth")
    observation, _ = environment.reset(options={"run": 0})
    simulation = environment._running()
    (target,) = np.flatnonzero(simulation.world().category == "pedestrian")
    ego, boxes = simulation.ego_box(), simulation.world().boxes
    offset = boxes.center_m[target] - ego.center_m[0]
    yaw = ego.yaw_rad[0]
    expected = (offset @ (np.cos(yaw), np.sin(yaw)), offset @ (-np.sin(yaw), np.cos(yaw)))
    assert observation["mask"].tolist() == [1] + [0] * 15
    first = dict(zip(OBJECT_COLUMNS, observation["objects"][0].tolist(), strict=True))
    np.testing.assert_allclose((first["ahead_m"], first["left_m"]), expected, rtol=1e-5)
    assert [first[f"is_{name}"] for name in CATEGORIES] == [name == "pedestrian" for name in CATEGORIES]


def test_an_agent_that_brakes_at_once_pays_for_its_deceleration() -> None:
    """The pedestrian waits for the ego, which stands: the run is cut off, nothing was to be braked for."""
    environment = cpna(speeds_kmh=(20.0,), strategies=("map",), reward=Reward(comfort=0.5, unnecessary=3.0))
    environment.reset(options={"run": 0})
    total, truncated = 0.0, False
    while not truncated:
        _, reward, terminated, truncated, info = environment.step(1)
        assert not terminated
        total += reward
    log = environment.outcome.log.table()
    of_ego = log["kind"] == "ego"
    lost, took = -np.diff(log["speed_mps"][of_ego]), np.diff(log["time_s"][of_ego])
    expected = -0.5 * float(((np.clip(lost, 0.0, None) / took / 9.80665) ** 2 * took).sum())
    assert expected < -0.5 * (20.0 / 3.6) * 0.5 * 14.5 / 9.80665**2  # more than half the brakes all the way
    assert (info["collided"], info["end_reason"], info["false_activation"]) == (False, "time_limit", True)
    np.testing.assert_allclose(total, expected - 3.0, rtol=1e-9)


def test_part_of_the_brakes_gives_that_part_of_the_deceleration() -> None:
    environment = cpna(speeds_kmh=(60.0,), strategies=("map",), actions="deceleration", preset="physical")
    environment.reset(options={"run": 0})
    for _ in range(60):
        environment.step(np.array([0.5], np.float32))
    assert environment.frame is not None
    np.testing.assert_allclose(environment.frame.ego.accel_mps2, -0.5 * 8.8, rtol=1e-6)


def test_a_run_that_is_cut_off_is_truncated() -> None:
    environment = gymnasium.make(
        "smartmot/Scenario-v0", scenario="ahead", parameters={"Target_speed_kmh": 80}
    ).unwrapped
    assert isinstance(environment, BrakingEnv)
    environment.reset(options={"run": 0})
    ended: tuple[bool, bool] = (False, False)
    while not any(ended):
        _, _, *flags, info = environment.step(0)
        ended = (bool(flags[0]), bool(flags[1]))
    assert ended == ((False, True) if info["end_reason"] in ("time_limit", "not_begun") else (True, False))


def test_a_picture_shows_the_ego_and_the_target() -> None:
    environment = cpna(speeds_kmh=(40.0,), strategies=("map",), render_mode="rgb_array")
    environment.reset(options={"run": 0})
    picture = environment.render()
    assert picture is not None
    assert (picture.shape, picture.dtype) == ((480, 480, 3), np.uint8)
    assert (picture == (0x4D, 0x4D, 0x4D)).all(axis=2).sum() == pytest.approx(
        4.4 * 1.8 * (480 / 60) ** 2, rel=0.2
    )


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"observe": "all"}, "observe: unknown 'all'; use one of: tracks"),
        ({"actions": "steer"}, "actions: unknown"),
        ({"render_mode": "human"}, "render_mode: unknown"),
        ({"objects": 0}, "objects: must be 1 or more"),
        ({"strategies": ("none",)}, "needs perception"),
    ],
)
def test_what_is_wrong_is_refused(options: dict[str, Any], said: str) -> None:
    with pytest.raises(ArgumentError, match=said):
        cpna_env(**options)


def test_weights_are_not_negative() -> None:
    with pytest.raises(ArgumentError, match="contact must be 0 or more, got -1"):
        Reward(contact=-1.0)


def test_steps_out_of_order_and_unknown_runs_are_refused() -> None:
    environment = cpna(speeds_kmh=(40.0,))
    for call in (lambda: environment.step(0), lambda: environment.row()):
        with pytest.raises(ArgumentError, match="reset"):
            call()
    for options in ({"run": 99}, {"run": "no such"}, {"speed": 3}):
        with pytest.raises(ArgumentError, match="reset: "):
            environment.reset(options=options)
    environment.reset(options={"run": 0})
    with pytest.raises(ArgumentError, match="is not in"):
        environment.step(2)


def test_an_import_registers_it_and_a_module_prefix_does_too() -> None:
    code = "import gymnasium as g; print(g.make('evaluation.gym:smartmot/CPNA-v0').unwrapped.run.scenario)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.strip()) == (0, "CPNA"), done.stderr


def test_the_code_of_the_page_runs(capsys: pytest.CaptureFixture[str]) -> None:
    page = (Path(__file__).parents[3] / "docs" / "gym.md").read_text()
    exec(page.split("```python\n")[1].split("```")[0], {})
    reason, speed, score = capsys.readouterr().out.split()
    assert (reason, float(speed), float(score) > 0.0) == ("stopped", 0.0, True)
