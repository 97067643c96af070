"""Steps per second of `smartmot/CPNA-v0` beside `highway-v0`, in turns in the same process.

    python -m benchmarks.environment [--seconds N]

Both environments step with an action that never brakes; `highway-v0` is as it ships (50 vehicles, a decision
a second). Resets count. Printed: medians of the turns, and their ratio.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from pathlib import Path
from typing import Any

if not __package__:
    # a script's own folder comes first, and has a module of the name opendrive
    sys.path[0] = str(Path(__file__).parents[1])

import gymnasium
import highway_env  # registers highway-v0

import evaluation.gym

TURNS = 5
IDLE = 1
"""`highway-v0`: keep lane and speed."""


def steps_per_s(environment: gymnasium.Env[Any, Any], action: int, seconds: float) -> float:
    """Steps per second of processor time."""
    start, steps = time.process_time(), 0
    environment.reset(seed=0)
    while (spent := time.process_time() - start) < seconds:
        _, _, terminated, truncated, _ = environment.step(action)
        steps += 1
        if terminated or truncated:
            environment.reset()
    return steps / spent


def main() -> None:
    """Print the rates."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seconds", type=float, default=3.0, help="of each turn")
    seconds = parser.parse_args().seconds
    both = {
        "smartmot/CPNA-v0": (gymnasium.make("smartmot/CPNA-v0"), 0),
        "highway-v0": (gymnasium.make("highway-v0"), IDLE),
    }
    rates: dict[str, list[float]] = {name: [] for name in both}
    for _ in range(TURNS):
        for name, (environment, action) in both.items():
            rates[name].append(steps_per_s(environment, action, seconds))
    medians = {name: statistics.median(values) for name, values in rates.items()}
    for name, rate in medians.items():
        print(f"{name}: {rate:.0f} steps per s")
    print(f"ratio: {medians['smartmot/CPNA-v0'] / medians['highway-v0']:.1f}")


if __name__ == "__main__":
    assert evaluation.gym
    assert highway_env
    main()
