"""Fit a MuJoCo model to logs with mujoco.sysid and simulate other logs with it.

    python mujoco_sysid.py MODEL.xml FOLD.json

prints the fitted parameters and the angles that MuJoCo predicts in each window of the test logs. The settings are those of
the toolbox's own examples: every body's inertia as a pseudo-inertia (10 parameters), damping, dry friction and armature
of every joint, default bounds and weights, the optimizer "mujoco", the integrator "implicitfast" in steps of 2 ms at most.
The training logs are cut into pieces, each simulated from the state at its start as the logs give it.
"""

import contextlib
import importlib
import json
import logging
import pathlib
import sys

for package in ("scipy", "absl", "colorama", "imageio", "jinja2", "matplotlib", "plotly", "yaml", "tabulate"):
    # The toolbox is silently empty where one of these is missing.
    importlib.import_module(package)

import mujoco
import mujoco.sysid as sysid
import numpy as np

LONGEST_STEP_S = 2e-3
# Of each joint's parameters: start, lowest and highest value in N m, rad and s.
JOINT = {"damping": (0.01, 0.0, 2.0), "frictionloss": (0.05, 0.0, 2.0), "armature": (0.002, 0.0, 0.2)}
# An angle or velocity beyond this has diverged.
SENSIBLE = 1e4


def read(path, logs):
    spec = mujoco.MjSpec.from_file(path)
    steps = [np.median(np.diff(log["time"])) for log in logs]
    spec.option.timestep = min(LONGEST_STEP_S, *steps)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for joint in spec.joints:
        spec.add_sensor(
            name=f"{joint.name}_position",
            type=mujoco.mjtSensor.mjSENS_JOINTPOS,
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            objname=joint.name,
        )
    return spec


def joint_parameter(joint, quantity):
    start, low, high = JOINT[quantity]

    def put(spec, parameter):
        joint_of = spec.joint(joint)
        old = getattr(joint_of, quantity)
        # Damping is a polynomial in recent versions; its first coefficient is the viscous one.
        value = parameter.value[0]
        setattr(joint_of, quantity, value if np.ndim(old) == 0 else [value, *np.asarray(old)[1:]])

    return sysid.Parameter(f"{joint}_{quantity}", nominal=start, min_value=low, max_value=high, modifier=put)


def inertia_parameter(spec, body):
    def put(spec, parameter):
        sysid.apply_body_inertia(spec, body, parameter)
        # Left undefined by the toolbox, which the compiler of MuJoCo 4.0 takes for a body without inertia.
        spec.body(body).iquat = [1, 0, 0, 0]

    kind = sysid.InertiaType.Pseudo
    return sysid.body_inertia_param(spec, spec.compile(), body, inertia_type=kind, modifier=put)


def parameters_of(spec):
    parameters = sysid.ParameterDict()
    for body in spec.bodies[1:]:
        parameters.add(inertia_parameter(spec, body.name))
    for joint in spec.joints:
        for quantity in JOINT:
            parameters.add(joint_parameter(joint.name, quantity))
    return parameters


def pieces(spec, log):
    """The pieces of a log: start states, torques held over each row, measured angles."""
    model = spec.compile()
    time, angles, torques = (np.array(log[key]) for key in ("time", "q", "tau"))
    for piece in log["windows"][0]:
        rows = slice(piece["first"], piece["last"] + 1)
        state = np.array(piece["state"])
        start = sysid.create_initial_state(model, state[: model.nq], state[model.nq :])
        held = sysid.TimeSeries(time[rows] - time[rows][0], torques[:, rows].T)
        held = held.resample(target_dt=model.opt.timestep, method="zoh")
        control = sysid.TimeSeries.from_control_names(held.times, held.data, model)
        measured = sysid.TimeSeries.from_names(time[rows] - time[rows][0], angles[:, rows].T, model)
        yield start, control, measured


def fit(spec, logs):
    starts, controls, measured = zip(*(piece for log in logs for piece in pieces(spec, log)))
    names = [f"piece_{k}" for k in range(len(starts))]
    sequences = sysid.ModelSequences("rig", spec, names, starts, controls, measured)
    residual = sysid.build_residual_fn(models_sequences=[sequences])
    # The optimizer prints every iteration.
    with contextlib.redirect_stdout(sys.stderr):
        found, _ = sysid.optimize(parameters_of(spec), residual, optimizer="mujoco", verbose=False)
    return found


def predict(model, data, log, window):
    """The angles at the rows of a window after its first, `[joint][row]`."""
    mujoco.mj_resetData(model, data)
    data.qpos, data.qvel = np.split(np.array(window["state"]), 2)
    longest, predicted = model.opt.timestep, []
    for row in range(window["first"], window["last"]):
        gap = log["time"][row + 1] - log["time"][row]
        count = max(1, int(np.ceil(gap / longest - 1e-6)))
        model.opt.timestep = gap / count
        data.ctrl = [torque[row] for torque in log["tau"]]
        for _ in range(count):
            mujoco.mj_step(model, data)
        predicted.append(data.qpos.copy())
    model.opt.timestep = longest
    predicted = np.nan_to_num(np.array(predicted).T, nan=SENSIBLE, posinf=SENSIBLE, neginf=-SENSIBLE)
    return np.round(np.clip(predicted, -SENSIBLE, SENSIBLE), 9).tolist()


def main():
    logging.disable(logging.WARNING)
    path, fold = sys.argv[1:]
    fold = json.loads(pathlib.Path(fold).read_text())
    spec = read(path, fold["train"] or fold["test"])
    found = fit(spec, fold["train"]) if fold["train"] else sysid.ParameterDict()
    model = sysid.apply_param_modifiers(found, spec)
    data = mujoco.MjData(model)
    predicted = [
        [[predict(model, data, log, window) for window in horizon] for horizon in log["windows"]]
        for log in fold["test"]
    ]
    parameters = {name: parameter.value.tolist() for name, parameter in found.items()}
    print(json.dumps({"mujoco": mujoco.__version__, "parameters": parameters, "predicted": predicted}))


main()
