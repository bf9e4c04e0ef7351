"""Run an exported ONNX model: python onnx.py MODEL.onnx SAMPLES.json prints what it predicts at the samples."""

import json
import pathlib
import sys

import numpy as np
import onnxruntime

path = pathlib.Path(sys.argv[1])
samples = json.loads(pathlib.Path(sys.argv[2]).read_text())
step = onnxruntime.InferenceSession(path)
derivative = onnxruntime.InferenceSession(path.with_name(f"{path.stem}-derivative{path.suffix}"))


def run(session, state, torque, time, memory=None):
    """Run a batch of rows through a graph, with those inputs that the graph has."""
    given = {"state": state, "torque": torque, "time": time, "memory": memory}
    given = {i.name: np.asarray(given[i.name], np.float32) for i in session.get_inputs()}
    return session.run(None, given)


def rest(rows):
    """The memory of delayed or lagged torques at rest."""
    width = [i.shape[1] for i in step.get_inputs() if i.name == "memory"]
    return np.zeros((rows, *width), np.float32)


def advance(state, torque, time, memory):
    outputs = dict(zip([o.name for o in step.get_outputs()], run(step, state, torque, time, memory)))
    return outputs["next_state"], outputs.get("next_memory", memory)


states, torques = samples["states"], samples["torques"]
start = np.zeros((len(states), 1))
next_states, _ = advance(states, torques, start, rest(len(states)))

state, memory, rollout = [samples["start"]], rest(1), []
for k, held in enumerate(samples["held"]):
    state, memory = advance(state, [held], [[k * samples["step_s"]]], memory)
    rollout.append(state[0].tolist())

answers = {
    "next": next_states.tolist(),
    "derivative": run(derivative, states, torques, start)[0].tolist(),
    "rollout": rollout,
}
print(json.dumps(answers))
