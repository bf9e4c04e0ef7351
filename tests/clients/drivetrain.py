"""Record logs of one driven joint that MuJoCo simulates: python drivetrain.py RIG.xml AMPLITUDE STEP_S SECONDS OUT.csv...

The control is a multisine that differs from log to log and falls with frequency; the encoder is on the first joint."""

import pathlib
import sys

import mujoco
import numpy as np

rig, amplitude, step_s, seconds, *logs = sys.argv[1:]
model = mujoco.MjModel.from_xml_path(rig)
every = round(float(step_s) / model.opt.timestep)
NOISE, ENCODER = 1e-4, 1e-5

for seed, path in enumerate(logs):
    rng = np.random.default_rng(seed)
    data = mujoco.MjData(model)
    frequencies = 0.2 * 40 ** ((np.arange(8) + rng.random(8)) / 8)
    phases = 2 * np.pi * rng.random(8)
    sizes = float(amplitude) / (1 + frequencies / 3)
    rows = ["time,q1,cmd1"]
    for k in range(round(float(seconds) / model.opt.timestep)):
        if k % every == 0:
            time = k * model.opt.timestep
            data.ctrl[0] = (sizes * np.sin(2 * np.pi * frequencies * time + phases)).sum()
            angle = np.round((data.qpos[0] + NOISE * rng.standard_normal()) / ENCODER) * ENCODER
            rows.append(",".join(repr(float(x)) for x in (time, angle, data.ctrl[0])))
        mujoco.mj_step(model, data)
    pathlib.Path(path).write_text("\n".join(rows) + "\n")
