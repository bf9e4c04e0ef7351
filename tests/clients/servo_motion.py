"""Move an exported servo rig in MuJoCo by the targets of a log: python servo_motion.py MODEL.xml LOG.csv fails unless each
joint moves as in the log, within 2 % of its motion."""

import csv
import sys

import mujoco
import numpy as np

SHARE = 0.02

model = mujoco.MjModel.from_xml_path(sys.argv[1])
data = mujoco.MjData(model)
with open(sys.argv[2]) as file:
    log = {name: np.array(column, float) for name, *column in zip(*csv.reader(file))}
n = model.nv
assert model.nu == n and model.na == 0, (model.nu, model.na)
q, qd, targets = (np.stack([log[f"{stem}{j + 1}"] for j in range(n)], axis=1) for stem in ("q", "qd", "cmd"))
substeps = (log["time"][1] - log["time"][0]) / model.opt.timestep
assert abs(substeps - round(substeps)) < 1e-6, substeps

data.qpos, data.qvel = q[0], qd[0]
# The rig had the first targets before the log began.
for j in np.flatnonzero(model.actuator_delay):
    mujoco.mj_initCtrlHistory(model, data, j, None, np.full((model.actuator_history[j, 0], 1), targets[0, j]))
moved = [q[0]]
for target in targets[:-1]:
    data.ctrl = target
    mujoco.mj_step(model, data, round(substeps))
    moved.append(data.qpos.copy())
shares = np.sqrt(np.mean((moved - q) ** 2, axis=0)) / np.std(q, axis=0)
print("difference as a share of the motion:", *(f"{share:.4f}" for share in shares))
assert np.all(shares < SHARE), shares
