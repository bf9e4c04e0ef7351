"""Rebuild an exported description with numpy: python description.py MODEL.json SAMPLES.json prints what it predicts."""

import json
import pathlib
import sys

import numpy as np
from safetensors.numpy import load_file

path = pathlib.Path(sys.argv[1])
model = json.loads(path.read_text())
samples = json.loads(pathlib.Path(sys.argv[2]).read_text())
weights = load_file(path.with_name(model["weights"]))
equations, n = model["equations"], model["joints"]

FUNCTIONS = {
    "neg": np.negative, "abs": np.abs, "sign": np.sign, "sqrt": np.sqrt, "exp": np.exp, "log": np.log,
    "sin": np.sin, "cos": np.cos, "tan": np.tan, "tanh": np.tanh, "atan2": np.arctan2,
    "add": np.add, "sub": np.subtract, "mul": np.multiply, "div": np.divide, "pow": np.power,
    "min": np.minimum, "max": np.maximum,
    "less": lambda a, b: (a < b) * 1.0,
    "where": lambda condition, a, b: np.where(condition > 0, a, b),
}  # fmt: skip


def network(prefix, q, qd, torque):
    """A network: its features scaled, its layers with ReLU between them."""
    shape = model["prior" if prefix else "residual"]
    angles = [q] if shape["angles"] == "raw" else [np.sin(q), np.cos(q)]
    x = np.concatenate([*angles, qd, torque], axis=-1) - shape["scaling"]["mean"]
    x = x / shape["scaling"]["std"]
    last = len(shape["widths"]) - 2
    for k in range(last + 1):
        x = x @ weights[f"{prefix}layers.{k}.weight"].astype(float).T + weights[f"{prefix}layers.{k}.bias"]
        x = x if k == last else np.maximum(x, 0.0)
    return x


def derivative(state, torque, time, begun=None, length=0.0):
    """ds/dt of rows of states while torques act; of states of effects the mean rates over a step from `begun`."""
    of_effects = [*(state if begun is None else begun).T[2 * n :], length] if equations["states"] else []
    parameters = [weights[f"parameters.{p['name']}"] for p in model["parameters"]]
    inputs = [*state.T, *torque.T, time, *of_effects, *parameters]
    values = []
    for name, *arguments in equations["operations"]:
        if name == "input":
            values.append(inputs[arguments[0]])
        elif name == "const":
            values.append(arguments[0])
        else:
            values.append(FUNCTIONS[name](*(values[k] for k in arguments)))
    rates = np.stack([values[k] + np.zeros(len(state)) for k in equations["outputs"]], axis=-1)
    for prefix in equations["networks"]:
        parts = network(prefix, state[:, :n], state[:, n : 2 * n], torque)
        rates[:, 2 * n - parts.shape[1] : 2 * n] += parts
    return rates


def advance(state, torque, time, h):
    """One substep: an explicit Runge-Kutta method whose stages each need the one before."""
    inner = end = state
    for after, reach, weight in equations["stages"]:
        rates = derivative(inner, torque, time + after * h, state, h)
        end = end + weight * h * rates
        inner = state + reach * h * rates
    if equations["semi_implicit"]:
        end[:, :n] += h * h * rates[:, n : 2 * n]
    return end


def rest(rows):
    """At rest: for each filtered joint earlier torques, newest first, and the lagged torque."""
    return [[np.zeros((f["past"], rows)), np.zeros(rows)] for f in equations["held"]]


def step(state, torque, time, memory):
    """The next state, and the memory of delayed and lagged torques."""
    substeps, left = equations["substeps"], []
    acting = np.repeat(torque[None], substeps, axis=0)
    for f, (past, lagged) in zip(equations["held"], memory):
        past = np.vstack([torque[:, f["joint"]], past])
        first, then = (past[k] for k in f["places"])
        sources = np.array([lagged, first, then])
        acting[:, :, f["joint"]] = [np.dot(factors, sources) for factors in f["mean"]]
        left.append([past[: f["past"]], np.dot(f["end"], sources)])
    h = model["step_s"] / substeps
    for k, held in enumerate(acting):
        state = advance(state, held, time + k * h, h)
    return state, left


states, torques = np.array(samples["states"]), np.array(samples["torques"])
next_states, _ = step(states, torques, 0.0, rest(len(states)))

state, memory, rollout = np.array([samples["start"]]), rest(1), []
for k, held in enumerate(samples["held"]):
    state, memory = step(state, np.array([held]), k * model["step_s"], memory)
    rollout.append(state[0].tolist())

answers = {
    "next": next_states.tolist(),
    "derivative": derivative(states, torques, 0.0).tolist(),
    "rollout": rollout,
}
print(json.dumps(answers))
