"""Run an exported URDF model in MuJoCo: python urdf.py MODEL.urdf SAMPLES.json prints what it predicts at the samples."""

import json
import pathlib
import sys
import xml.etree.ElementTree as ElementTree

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
width = np.array(ElementTree.parse(path).find("residyn").get("dry_friction_width").split(), float)


def smooth_friction(_, data):
    data.qfrc_passive -= level * np.tanh(data.qvel / width)


if level.any():
    mujoco.set_mjcb_passive(smooth_friction)

# States of effects are not carried, and stay at zero here.
still = np.zeros(len(samples["start"]) - 2 * n)

# Effort limits of the joints.
limited = model.jnt_actfrclimited.astype(bool)
least, most = (np.where(limited, bound, side) for bound, side in zip(model.jnt_actfrcrange.T, (-np.inf, np.inf)))


def begin(state, torque):
    mujoco.mj_resetData(model, data)
    data.qpos, data.qvel = state[:n], state[n : 2 * n]
    data.qfrc_applied = np.clip(torque, least, most)


def derivative(state, torque):
    begin(state, torque)
    mujoco.mj_forward(model, data)
    return [*data.qvel, *data.qacc, *still]


def next_state(state, torque):
    begin(state, torque)
    for _ in range(round(samples["step_s"] / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return [*data.qpos, *data.qvel, *still]


points = list(zip(samples["states"], samples["torques"]))
state, rollout = samples["start"], []
for torque in samples["held"]:
    state = next_state(state, torque)
    rollout.append(state)
answers = {
    "derivative": [derivative(*point) for point in points],
    "next": [next_state(*point) for point in points],
    "rollout": rollout,
}
print(json.dumps(answers))
