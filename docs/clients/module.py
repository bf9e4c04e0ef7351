"""Run an exported Python module: python module.py MODEL.py SAMPLES.json prints what it predicts at the samples."""

import json
import pathlib
import runpy
import sys
import types

# What `import model` does, for a file anywhere.
model = types.SimpleNamespace(**runpy.run_path(sys.argv[1]))
samples = json.loads(pathlib.Path(sys.argv[2]).read_text())

# Any number of rows at once.
states, torques = samples["states"], samples["torques"]
next_states, _ = model.step(states, torques)

# One row after the other.
state, memory, rollout = samples["start"], None, []
for k, held in enumerate(samples["held"]):
    state, memory = model.step(state, held, memory, time=k * model.STEP)
    rollout.append(state.tolist())

answers = {
    "next": next_states.tolist(),
    "derivative": model.derivative(states, torques).tolist(),
    "rollout": rollout,
}
print(json.dumps(answers))
