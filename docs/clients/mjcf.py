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
n = samples["joints"]

# A motor behind a transmission has a joint of its own, and another one on the same axis by which its link leads it. For each
# joint of the exported model: the side of its sensor (1: motor, 0: link, -1: rigid), and the place of its twist in a state.
custom = {model.numeric(k).name: model.numeric(k).data for k in range(model.nnumeric)}
sides, places = custom.get("transmissions", -np.ones(2 * n)).reshape(n, 2).T.astype(int)
dofs = np.cumsum([0, *(sides >= 0) + 1])[:-1]


def split(state):
    """Positions and velocities in MuJoCo, of a state of the model."""
    motion = np.zeros((2, model.nv))
    for k, (side, place, dof) in enumerate(zip(sides, places, dofs)):
        for part, values in enumerate(motion):
            shown, ahead = state[part * n + k], state[place + part] if side >= 0 else 0
            values[dof] = shown if side != 0 else shown + ahead
            if side >= 0:
                values[dof + 1] = -ahead
    return motion


def joined(motion):
    """The state of the model, or its rates. States of other effects are not carried, and stay at zero here."""
    state = np.zeros(len(samples["start"]))
    for k, (side, place, dof) in enumerate(zip(sides, places, dofs)):
        for part, values in enumerate(motion):
            state[part * n + k] = values[dof] + (values[dof + 1] if side == 0 else 0)
            if side >= 0:
                state[place + part] = -values[dof + 1]
    return state.tolist()


# In MuJoCo dry friction is a constraint, which lets joints stick; in the exported model it is smooth. With the smooth form in
# its place, everything else can be compared exactly. On a link behind a transmission it acts along a tendon.
level, model.dof_frictionloss[:] = model.dof_frictionloss.copy(), 0
pull, model.tendon_frictionloss[:] = model.tendon_frictionloss.copy(), 0
width = np.ones(model.nv)
width[dofs] = custom["dry_friction_width"]
along = np.array([width[model.jnt_dofadr[model.wrap_objid[adr]]] for adr in model.tendon_adr])


def smooth_friction(_, data):
    data.qfrc_passive -= level * np.tanh(data.qvel / width)
    if pull.any():
        jacobian = np.zeros((model.ntendon, model.nv))
        for k, adr in enumerate(model.tendon_adr):
            for wrap in range(adr, adr + model.tendon_num[k]):
                jacobian[k, model.jnt_dofadr[model.wrap_objid[wrap]]] = model.wrap_prm[wrap]
        data.qfrc_passive -= jacobian.T @ (pull * np.tanh(jacobian @ data.qvel / along))


if level.any() or pull.any():
    mujoco.set_mjcb_passive(smooth_friction)


def begin(state):
    mujoco.mj_resetData(model, data)
    data.qpos, data.qvel = split(state)


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
    return joined([data.qvel, data.qacc])


def advance(torque):
    data.ctrl = torque
    for _ in range(round(samples["step_s"] / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return joined([data.qpos, data.qvel])


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
