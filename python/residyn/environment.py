"""A simulated rig as a Gymnasium environment; needs the package gymnasium (`pip install residyn[environment]`)."""

import os
from typing import Any

import gymnasium
import numpy
from numpy.typing import NDArray

from ._residyn import Rig

Array = NDArray[numpy.float64]


class Environment(gymnasium.Env[Array, Array]):
    """Any plant with any task: observations are measured positions, then velocities; actions are torques in N m (or N).

    An episode is truncated after the steps of its task. The reward is the task's.
    """

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(self, plant: str | os.PathLike[str], task: str | os.PathLike[str] | None = None) -> None:
        """
        Args:
            plant: a plant or model file, or a built-in plant or system by its name.
            task: a task file, or a built-in task; by default a built-in one of the plant's system.
        """
        self._rig = Rig(plant, task)
        self._steps = 0
        low, high = self._rig.action_bounds
        self.action_space = gymnasium.spaces.Box(low, high, dtype=numpy.float64)
        unbounded = numpy.full(2 * self._rig.joints, numpy.inf)
        self.observation_space = gymnasium.spaces.Box(-unbounded, unbounded, dtype=numpy.float64)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Array, dict[str, Any]]:
        """Begin an episode from a start state that is drawn from the task's."""
        super().reset(seed=seed)
        self._steps = 0
        return self._rig.reset(seed), {}

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Hold the torque for a step; a torque outside the task's bounds is clipped to them."""
        assert isinstance(self.action_space, gymnasium.spaces.Box)
        measured, reward = self._rig.step(numpy.clip(action, self.action_space.low, self.action_space.high))
        self._steps += 1
        return measured, reward, False, self._steps >= self._rig.episode_steps, {}
