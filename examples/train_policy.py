"""A small policy that learns when to brake, and the shipped rules beside it, on scenes it has not seen.

    python examples/train_policy.py [--seconds 120] [--seed 0]

The policy has three numbers: it brakes, and holds the brake until the ego stands, once an object is so near
in time (its time to contact along the ego's way) and so near to that way then (its offset, with a margin
that grows with the time). The cross-entropy method draws them around the best of the last generation. It
learns from every second scene of `smartmot-eval compare`, and is shown on the others, some of which ask for
no brake.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np

import evaluation.gym as braking
from evaluation.runs.execution import execute

AHEAD, LEFT, V_AHEAD, V_LEFT, LENGTH, WIDTH = (
    braking.OBJECT_COLUMNS.index(name)
    for name in ("ahead_m", "left_m", "ahead_mps", "left_mps", "length_m", "width_m")
)
EGO_LENGTH_M, EGO_WIDTH_M = 4.4, 1.8
POPULATION, ELITE = 10, 3
TRAINED_SCENES = 8
"""Drawn anew for each generation."""
START = (np.array([1.5, 0.3, 0.2]), np.array([0.5, 0.3, 0.2]))
"""Mean and spread of: time (s), margin (m), growth of the margin (m/s)."""


def brakes(observation: dict[str, Any], policy: np.ndarray) -> bool:
    """Whether the policy begins to brake."""
    time_s, margin_m, growth_mps = np.abs(policy)
    objects = observation["objects"][observation["mask"] == 1]
    closing = np.maximum(observation["ego"][0] - objects[:, V_AHEAD], 0.1)
    gap = objects[:, AHEAD] - (EGO_LENGTH_M + objects[:, LENGTH]) / 2
    contact_s = np.maximum(gap, 0.0) / closing
    offset = np.abs(objects[:, LEFT] + objects[:, V_LEFT] * contact_s) - (EGO_WIDTH_M + objects[:, WIDTH]) / 2
    return bool(
        ((gap > -EGO_LENGTH_M) & (contact_s < time_s) & (offset < margin_m + growth_mps * contact_s)).any()
    )


def episode(environment: braking.BrakingEnv, run: int, policy: np.ndarray) -> float:
    """The return of an episode."""
    observation, _ = environment.reset(options={"run": run})
    total, held, ended = 0.0, False, False
    while not ended:
        held = brakes(observation, policy) or (held and observation["ego"][0] > 0.1)
        observation, reward, terminated, truncated, _ = environment.step(int(held))
        total, ended = total + reward, terminated or truncated
    return total


def learned(environment: braking.BrakingEnv, runs: list[int], seconds: float, seed: int) -> np.ndarray:
    """The policy after a time of learning."""
    generator = np.random.default_rng(seed)
    mean, spread = START
    until, generation = time.monotonic() + seconds, 0
    while time.monotonic() < until:
        scenes = generator.choice(runs, TRAINED_SCENES, replace=False).tolist()
        policies = mean + spread * generator.standard_normal((POPULATION, len(mean)))
        returns = [np.mean([episode(environment, run, policy) for run in scenes]) for policy in policies]
        best = policies[np.argsort(returns)[-ELITE:]]
        mean, spread = best.mean(axis=0), 0.7 * spread + 0.3 * best.std(axis=0)
        generation += 1
        print(f"generation {generation}: return {max(returns):.2f}, policy {np.abs(mean).round(2).tolist()}")
    return mean


def main() -> None:
    """Learn, then compare."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=120.0, help="of learning")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    environment = gymnasium.make("smartmot/Scenes-v0", strategy="all").unwrapped
    assert isinstance(environment, braking.BrakingEnv)
    runs = range(len(environment.runs))
    policy = learned(environment, [k for k in runs if k % 2 == 0], asked.seconds, asked.seed)

    shown = [k for k in runs if k % 2 == 1]
    rows = {"learned": []}
    for k in shown:
        episode(environment, k, policy)
        rows["learned"].append(environment.row())
    for rule in ("paper", "cascade", "rss"):
        settings = () if rule == "paper" else (("rule", rule),)
        specs = [replace(environment.runs[k], settings=settings) for k in shown]
        rows[rule] = [execute(spec, keep_log=False).row for spec in specs]
    must = [environment.runs[k].must for k in shown]
    print(f"{len(shown)} other scenes: {must.count('brake')} ask for a brake, {must.count('nothing')} do not")
    for name, own in rows.items():
        avoided = sum(row.avoided for row, asked_for in zip(own, must, strict=True) if asked_for == "brake")
        false = sum(bool(row.false_activation) for row in own)
        print(f"{name:>8}: {avoided} collisions avoided, {false} false or early activations")


if __name__ == "__main__":
    main()
