"""Run an exported MJCF model in MuJoCo: python mjcf.py MODEL.xml SAMPLES.json prints what it predicts at the samples."""

import json
import pathlib
import sys

import mujoco
import numpy as np

path, question = sys.argv[1:]
samples = json.loads(pathlib.Path(question).read_text())
model = mujoco.MjModel.from_xml_path(path)
data = mujoco.MjData(model)
n = model.nv

# In MuJoCo dry friction is a constraint, which lets joints stick; in the exported model it is smooth. With the smooth form in
# its place, everything else can be compared exactly.
level, model.dof_frictionloss[:] = model.dof_frictionloss.copy(), 0
width = model.numeric("dry_friction_width").data


def smooth_friction(_, data):
    data.qfrc_passive -= level * np.tanh(data.qvel / width)


if level.any():
    mujoco.set_mjcb_passive(smooth_friction)


def begin(state):
    mujoco.mj_resetData(model, data)
    data.qpos, data.qvel = state[:n], state[n:]


# Delays of the commands, which MuJoCo 3.5 and later know.
delay = getattr(model, "actuator_delay", np.zeros(0))
delays = delay.copy()


def derivative(state, torque):
    """The torque acts: for a drive with a delay or a lag it is the delayed or lagged torque."""
    begin(state)
    data.ctrl, delay[:] = torque, 0
    data.act = [t for t, address in zip(torque, model.actuator_actadr) if address >= 0]
    mujoco.mj_forward(model, data)
    delay[:] = delays
    return [*data.qvel, *data.qacc]


def advance(torque):
    data.ctrl = torque
    for _ in range(round(samples["step_s"] / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return [*data.qpos, *data.qvel]


def next_state(state, torque):
    begin(state)
    return advance(torque)


points = list(zip(samples["states"], samples["torques"]))
answers = {"derivative": [derivative(*point) for point in points]}
if not model.na:
    answers["next"] = [next_state(*point) for point in points]
    begin(samples["start"])
    answers["rollout"] = [advance(torque) for torque in samples["held"]]
print(json.dumps(answers))
