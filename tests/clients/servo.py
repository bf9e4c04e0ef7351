"""Record logs of a rig that MuJoCo simulates: python servo.py RIG.xml DELAY_S OUT.csv...

The position targets of its actuators, multisines that differ from log to log, reach them late; the encoders round."""

import pathlib
import sys

import mujoco
import numpy as np

rig, delay_s, *logs = sys.argv[1:]
model = mujoco.MjModel.from_xml_path(rig)
n = model.nv
SAMPLE_S, DURATION_S, ENCODER, NOISE = 0.01, 8.0, 2 * np.pi / 16384, 1e-4
every = round(SAMPLE_S / model.opt.timestep)
late = round(float(delay_s) / model.opt.timestep)

for seed, path in enumerate(logs):
    rng = np.random.default_rng(seed)
    data = mujoco.MjData(model)
    frequencies = 0.1 * 20 ** ((np.arange(8) + rng.random((n, 8))) / 8)
    phases = 2 * np.pi * rng.random((n, 8))
    steps = round(DURATION_S / model.opt.timestep)
    held = np.arange(steps) // every * SAMPLE_S
    targets = 0.3 * np.sin(2 * np.pi * frequencies[:, :, None] * held + phases[:, :, None]).sum(axis=1).T
    rows = ["time," + ",".join(f"{stem}{j + 1}" for stem in ("q", "cmd") for j in range(n))]
    for k in range(steps):
        if k % every == 0:
            angles = np.round((data.qpos + NOISE * rng.standard_normal(n)) / ENCODER) * ENCODER
            rows.append(",".join(repr(float(x)) for x in (k // every * SAMPLE_S, *angles, *targets[k])))
        data.ctrl = targets[max(k - late, 0)]
        mujoco.mj_step(model, data)
    pathlib.Path(path).write_text("\n".join(rows) + "\n")
