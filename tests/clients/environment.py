"""Put the environment of an exported Python module through gymnasium's checker, and compare its rewards."""

import json
import pathlib
import runpy
import sys
import types

import numpy as np
from gymnasium.utils.env_checker import check_env

model = types.SimpleNamespace(**runpy.run_path(sys.argv[1]))
expected = json.loads(pathlib.Path(sys.argv[2]).read_text())

environment = model.Environment()
check_env(environment, skip_render_check=True)

rewards = model.reward(expected["states"], expected["torques"])
assert np.allclose(rewards, expected["rewards"], rtol=1e-12, atol=1e-12), rewards

observation, _ = environment.reset(seed=3)
action = np.array(expected["torques"][0])
after, won, terminated, truncated, _ = environment.step(action)
state, memory = np.concatenate([observation, model.START[len(observation) :]]), None
for _ in range(round(model.TASK["hold_s"] / model.STEP)):
    state, memory = model.step(state, action, memory)
state = state[: len(after)]
assert np.array_equal(after, state), (after, state)
assert won == model.reward(after, action, model.TASK["hold_s"]) and not (terminated or truncated)
again, _ = environment.reset(seed=3)
assert np.array_equal(again, observation)
