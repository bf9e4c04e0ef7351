import warnings

import numpy as np
import pytest
import residyn
from gymnasium.utils.env_checker import check_env
from residyn.environment import Environment


@pytest.mark.parametrize("plant", ["pendulum-real", "acrobot"])
def test_gymnasium_accepts_it(plant: str) -> None:
    with warnings.catch_warnings():
        # Torques are in N m, not between -1 and 1, and a velocity has no bounds.
        warnings.simplefilter("ignore")
        check_env(Environment(plant), skip_render_check=True)


def test_an_episode_is_that_of_its_seed() -> None:
    def episode(seed: int) -> tuple[np.ndarray, float]:
        environment = Environment("pendulum-real", "pendulum-rig")
        states = [environment.reset(seed=seed)[0]]
        total, ended = 0.0, False
        while not ended:
            state, reward, _, ended, _ = environment.step(np.array([np.sin(len(states))]))
            states.append(state)
            total += reward
        return np.array(states), total

    states, total = episode(3)
    again, same = episode(3)
    other, _ = episode(4)
    assert np.array_equal(states, again) and total == same
    assert states.shape == other.shape and not np.array_equal(states, other)


def test_the_reward_is_the_tasks() -> None:
    # The built-in task has no noise, and its reward is cos(q1) after the step.
    environment = Environment("pendulum")
    environment.reset(seed=1)
    for _ in range(20):
        state, reward, *_ = environment.step(np.array([0.5]))
        assert abs(reward - np.cos(state[0])) < 1e-12


def test_a_plant_without_a_task_is_refused() -> None:
    with pytest.raises(residyn.ResidynError, match="no built-in task is for servo"):
        Environment("servo-real")


def test_a_rig_needs_its_start() -> None:
    with pytest.raises(residyn.ResidynError, match="call reset first"):
        residyn.Rig("pendulum").step([0.0])


def test_what_a_rig_says_has_names() -> None:
    rig = residyn.Rig("acrobot")
    low, high = rig.action_bounds
    assert low.shape == high.shape == (2,) and (low <= high).all() and rig.episode_steps > 1
    rig.reset(seed=1)
    step = rig.step([0.0, 0.0])
    assert step.state.shape == (4,) and step == (step.state, step.reward)
