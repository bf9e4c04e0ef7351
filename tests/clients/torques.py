"""Compare the torques that a measured motion needs by MuJoCo's inverse dynamics of an exported model with those that acted.

Arguments: the model, and a file with the smoothed motion and the relative torque error that the exporter finds.
"""

import json
import sys

import mujoco
import numpy

model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
with open(sys.argv[2]) as file:
    log = json.load(file)
differences = []
for row in zip(*(numpy.transpose(log[key]) for key in ("q", "qd", "tau", "qdd"))):
    data.qpos, data.qvel, data.ctrl, acceleration = row
    mujoco.mj_fwdPosition(model, data)
    mujoco.mj_fwdVelocity(model, data)
    mujoco.mj_fwdActuation(model, data)
    data.qacc = acceleration
    mujoco.mj_inverse(model, data)
    differences.append(data.qfrc_inverse - data.qfrc_actuator)
relative = numpy.linalg.norm(differences) / numpy.linalg.norm(log["tau"])
print(f"relative torque error {relative:.5f}, by the exporter {log['relative']:.5f}")
assert len(differences) > 1000, len(differences)
# Friction that jumps where a smoothed velocity changes its sign does so before or after the torque that was smoothed like it.
assert relative < 1.1 * log["relative"], (relative, log["relative"])
