"""Compare a model file's motion with MuJoCo's inverse dynamics of the robot description that it was made from."""

import json
import pathlib
import sys

import mujoco
import numpy

description, samples = map(pathlib.Path, sys.argv[1:])
model = mujoco.MjModel.from_xml_path(str(description))
# Contacts, limits of positions and dry friction are constraints there, and no part of the comparison.
model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
data = mujoco.MjData(model)

found, wanted = [], []
for sample in json.loads(samples.read_text()):
    data.qpos, data.qvel, data.qacc = sample["q"], sample["qd"], sample["qdd"]
    mujoco.mj_inverse(model, data)
    found.append(sample["tau"])
    wanted.append(data.qfrc_inverse.copy())
found, wanted = numpy.array(found), numpy.array(wanted)
assert found.shape == wanted.shape and found.shape[0] >= 100, f"shapes {found.shape} and {wanted.shape}"
off = numpy.abs(found - wanted).max(axis=0) / numpy.abs(wanted).max(axis=0)
assert (off <= 1e-9).all(), f"torques of {description.name} are off by {off}"
print(f"{description.name}: {off}")
