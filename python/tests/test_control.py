from pathlib import Path

import numpy as np
import pytest
import residyn

# A short episode with a small planner.
TASK = """
system = "pendulum"
about = "kept from falling for a second"
objective = "cos(q1)"
steps = 50
step_s = 0.02
start = [0.2, 0.0]
torque = [[-8.0, 8.0]]
replan = 5

[planner]
method = "cem"
population = 60
elite = 6
iterations = 3
horizon = 20

[goal]
formula = "cos(q1)"
at_least = 0.95
hold_s = 0.2
"""


@pytest.fixture
def task(tmp_path: Path) -> Path:
    path = tmp_path / "balance.toml"
    path.write_text(TASK)
    return path


def test_a_model_keeps_its_plant_upright(pendulum: residyn.Model, task: Path) -> None:
    first, second = residyn.control(pendulum, "pendulum-real", task, episodes=2, seed=1)
    assert first.success and second.success
    assert first.rewards.shape == (50,) and np.isclose(first.total, first.rewards.sum())
    assert len(first.log) == 51 and first.log.tau is not None and np.abs(first.log.tau).max() <= 8.0
    (again,) = residyn.control(pendulum, "pendulum-real", task, seed=1)
    assert np.array_equal(again.log.q, first.log.q)


def test_a_checkpoint_plans_as_well(task: Path) -> None:
    shipped = Path(__file__).parents[2] / "checkpoints" / "pendulum-sim"
    (episode,) = residyn.control(shipped, "pendulum-sim", task)
    assert episode.success


def test_a_model_of_another_plant_is_refused(task: Path) -> None:
    with pytest.raises(residyn.ResidynError, match="acrobot has 2 joints, but the plant pendulum has 1"):
        residyn.control(residyn.Model.read("acrobot"), "pendulum-real", task)
