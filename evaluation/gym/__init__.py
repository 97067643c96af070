"""Environments for Gymnasium: agents that brake in our scenarios. Importing this registers them; docs/gym.md.

    import gymnasium, evaluation.gym
    environment = gymnasium.make("smartmot/CPNA-v0")

or, without the import, `gymnasium.make("evaluation.gym:smartmot/CPNA-v0")`.
"""

from gymnasium.envs.registration import register, registry

from evaluation.gym.environment import BrakingEnv
from evaluation.gym.observation import OBJECT_COLUMNS, OBSERVED
from evaluation.gym.reward import Reward

__all__ = ["OBJECT_COLUMNS", "OBSERVED", "BrakingEnv", "Reward"]

for _name in ("CPNA", "Scenario", "Scenes"):
    if f"smartmot/{_name}-v0" not in registry:
        register(f"smartmot/{_name}-v0", entry_point=f"evaluation.gym.registered:{_name.lower()}")
