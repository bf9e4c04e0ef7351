"""MuJoCo models as plants; needs `pip install residyn[plants]`.

    python -m residyn.plants.mujoco arm.xml --step 0.02 --delay 1 --encoder-step 0.0015

serves any MJCF model of hinge and slide joints that motors or position servos drive. A joint without an actuator is a joint with
the command limits 0 to 0.
"""

import math
import os
import sys
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import mujoco  # type: ignore[import-untyped]
import numpy

from .limits import Interval, Limits
from .plant import Array, Plant, PlantError, Row
from .serve import parser, serve_at

# After these, MuJoCo goes on from another state than the one that diverged.
_DIVERGED = ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC", "mjWARN_BADCTRL")
# Dynamics of an actuator after which its output is still the command, if late.
_LAGS = (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)


@dataclass(frozen=True)
class Sensors:
    """How a simulated plant is measured.

    Attributes:
        position_noise: standard deviation in rad (or m).
        velocity_noise: standard deviation in rad/s (or m/s).
        encoder_step: step of the encoders in rad (or m), to which positions are rounded; 0 for none. An encoder measures no
            velocity: with a step, rows have none.
    """

    position_noise: float = 0.0
    velocity_noise: float = 0.0
    encoder_step: float = 0.0

    def __post_init__(self) -> None:
        values = (self.position_noise, self.velocity_noise, self.encoder_step)
        if not all(math.isfinite(value) and value >= 0 for value in values):
            raise PlantError("noise and the encoders' step are finite and not negative")


class MujocoPlant(Plant):
    """A MuJoCo model as a plant on the simulated clock.

    Joints are all joints of the model in its order. With motors commands are torques, with position servos positions. Limits are
    the ranges of the joints and, for commands, `ctrlrange`, together with `forcerange` for motors. An episode begins at the
    model's first keyframe, or else at its reference configuration, at which position servos are safe as well. The torque of a row
    is the mean over its step of what the actuators apply (`qfrc_actuator`).
    """

    def __init__(
        self,
        model: str | os.PathLike[str],
        *,
        step_s: float,
        delay: int = 0,
        sensors: Sensors | None = None,
        rate: float | None = None,
        speed: float | None = None,
    ) -> None:
        """
        Args:
            model: an MJCF file, or its text.
            step_s: how long a command is held in s, a multiple of the model's time step.
            delay: steps until a command acts.
            sensors: how it is measured; exactly by default.
            rate: fastest change of a command per second.
            speed: greatest speed of a joint in rad/s (or m/s).

        Raises:
            PlantError: a model that cannot be read, or has something else than such joints and actuators.
        """
        self._model = _read(model)
        self._data = mujoco.MjData(self._model)
        self._sensors = sensors or Sensors()
        self._delay = _checked_delay(delay)
        self._substeps = _substeps(self._model, step_s)
        _refuse_other_joints(self._model)
        actuators = _actuators(self._model)
        self.command = _command(actuators)
        self.step_s = step_s
        self.joints = [_joint_name(self._model, joint) for joint in range(self._model.njnt)]
        self.name = f"{_model_name(self._model)} in MuJoCo"
        self.limits = _limits(self._model, actuators, rate, speed)
        self._actuators = actuators
        self._begin(None)
        self.safe = self._safe()
        self._random = numpy.random.default_rng(0)
        self._waiting: deque[Array] = deque()

    def reset(self, seed: int, start: Array | None) -> Row:
        """Begin at the model's start, or at the given one."""
        self._random = numpy.random.default_rng(seed)
        self._waiting = deque([numpy.array(self.safe)] * self._delay)
        self._begin(start)
        self._control(numpy.array(self.safe))
        mujoco.mj_forward(self._model, self._data)
        return self._row(self._data.qfrc_actuator.copy())

    def step(self, command: Array) -> Row:
        """Hold a command for a step, or the one that has come through the delay."""
        self._waiting.append(command)
        self._control(self._waiting.popleft())
        total = numpy.zeros(self._model.nv)
        for _ in range(self._substeps):
            mujoco.mj_step(self._model, self._data)
            total += self._data.qfrc_actuator
        self._check()
        return self._row(total / self._substeps)

    def _begin(self, start: Array | None) -> None:
        if self._model.nkey:
            mujoco.mj_resetDataKeyframe(self._model, self._data, 0)
        else:
            mujoco.mj_resetData(self._model, self._data)
        if start is not None:
            self._data.qpos[:], self._data.qvel[:] = numpy.split(start, 2)

    def _control(self, command: Array) -> None:
        for joint, actuator in self._actuators.items():
            self._data.ctrl[actuator.index] = command[joint] * actuator.control

    def _check(self) -> None:
        for name in _DIVERGED:
            if self._data.warning[getattr(mujoco.mjtWarning, name)].number:
                raise PlantError(f"the simulation diverged ({name}): a smaller timestep in the model may help")

    def _row(self, tau: Array) -> Row:
        sensors, joints = self._sensors, len(self.joints)
        q = self._data.qpos + sensors.position_noise * self._random.standard_normal(joints)
        qd = self._data.qvel + sensors.velocity_noise * self._random.standard_normal(joints)
        if sensors.encoder_step:
            return Row(q=numpy.round(q / sensors.encoder_step) * sensors.encoder_step, tau=tau)
        return Row(q=q, qd=qd, tau=tau)

    def _safe(self) -> Array:
        low, high = numpy.array(self.limits.command, float).T
        neutral = self._data.qpos if self.command == "position" else numpy.zeros(len(self.joints))
        return numpy.clip(neutral, low, high)


@dataclass(frozen=True)
class _Actuator:
    """What drives a joint.

    Attributes:
        index: in the model.
        kind: what it is commanded with.
        control: the model's control value for a command of 1.
        bounds: of the command.
    """

    index: int
    kind: Literal["torque", "position"]
    control: float
    bounds: Interval


def _read(model: str | os.PathLike[str]) -> Any:
    try:
        if isinstance(model, str) and model.lstrip().startswith("<"):
            return mujoco.MjModel.from_xml_string(model)
        return mujoco.MjModel.from_xml_path(os.fspath(model))
    except ValueError as error:
        raise PlantError(f"the model cannot be read: {error}") from None


def _refuse_other_joints(model: Any) -> None:
    names = {mujoco.mjtJoint.mjJNT_FREE: "free", mujoco.mjtJoint.mjJNT_BALL: "ball"}
    for joint in range(model.njnt):
        if (kind := names.get(mujoco.mjtJoint(int(model.jnt_type[joint])))) is not None:
            raise PlantError(
                f"joint {joint + 1} ({_joint_name(model, joint)}) is a {kind} joint: a plant has hinge and slide joints alone; "
                "fix the body to the world, or use hinges"
            )
    if model.njnt == 0:
        raise PlantError("the model has no joints")


def _actuators(model: Any) -> Mapping[int, _Actuator]:
    """What drives each driven joint."""
    found: dict[int, _Actuator] = {}
    for index in range(model.nu):
        name = _name(model, mujoco.mjtObj.mjOBJ_ACTUATOR, index, f"actuator {index + 1}")
        if mujoco.mjtTrn(int(model.actuator_trntype[index])) != mujoco.mjtTrn.mjTRN_JOINT:
            raise PlantError(f"{name} does not drive a joint directly: give each driven joint an actuator of its own")
        joint = int(model.actuator_trnid[index, 0])
        if joint in found:
            raise PlantError(f"joint {_joint_name(model, joint)} has more than one actuator")
        found[joint] = _actuator(model, index, name)
    return found


def _actuator(model: Any, index: int, name: str) -> _Actuator:
    gain, gear = model.actuator_gainprm[index, 0], model.actuator_gear[index, 0]
    kind = _kind(model, index)
    if kind is None or gear == 0 or gain == 0:
        raise PlantError(f"{name} is neither a motor nor a position servo: commands are torques or positions")
    # A motor applies gear times gain times control; a servo holds gear times the position at control.
    control = 1 / (gear * gain) if kind == "torque" else gear
    return _Actuator(index, kind, control, _bounds(model, index, kind, control, name))


def _kind(model: Any, index: int) -> Literal["torque", "position"] | None:
    # Of MuJoCo's enumerations only members are equal to each other in any version.
    gain = mujoco.mjtGain(int(model.actuator_gaintype[index]))
    bias = mujoco.mjtBias(int(model.actuator_biastype[index]))
    if gain != mujoco.mjtGain.mjGAIN_FIXED or mujoco.mjtDyn(int(model.actuator_dyntype[index])) not in _LAGS:
        return None
    if bias == mujoco.mjtBias.mjBIAS_NONE:
        return "torque"
    offset, stiffness = model.actuator_biasprm[index, :2]
    is_servo = bias == mujoco.mjtBias.mjBIAS_AFFINE and offset == 0
    return "position" if is_servo and stiffness == -model.actuator_gainprm[index, 0] else None


def _bounds(model: Any, index: int, kind: str, control: float, name: str) -> Interval:
    low, high = -math.inf, math.inf
    if model.actuator_ctrllimited[index]:
        low, high = sorted(model.actuator_ctrlrange[index] / control)
    if kind == "torque" and model.actuator_forcelimited[index]:
        forces = sorted(model.actuator_forcerange[index] * model.actuator_gear[index, 0])
        low, high = max(low, forces[0]), min(high, forces[1])
    if not (math.isfinite(low) and math.isfinite(high)):
        raise PlantError(f"{name} has no ctrlrange: give it one, for a plant says what may be commanded")
    return float(low), float(high)


def _command(actuators: Mapping[int, _Actuator]) -> Literal["torque", "position"]:
    kinds = {actuator.kind for actuator in actuators.values()}
    if len(kinds) > 1:
        raise PlantError("some actuators are motors and some are position servos: a plant has one kind of command")
    return kinds.pop() if kinds else "torque"


def _limits(model: Any, actuators: Mapping[int, _Actuator], rate: float | None, speed: float | None) -> Limits:
    joints = range(model.njnt)
    ranges = [tuple(map(float, model.jnt_range[joint])) if model.jnt_limited[joint] else None for joint in joints]
    return Limits(
        command=[actuators[joint].bounds if joint in actuators else (0.0, 0.0) for joint in joints],
        rate=_everywhere(rate, model.njnt),
        speed=_everywhere(speed, model.njnt),
        angle=[None if ends is None else (ends[0], ends[1]) for ends in ranges] if any(ranges) else None,
    )


def _everywhere(limit: float | None, joints: int) -> Sequence[float] | None:
    return None if limit is None else [limit] * joints


def _substeps(model: Any, step_s: float) -> int:
    timestep = float(model.opt.timestep)
    count = round(step_s / timestep) if math.isfinite(step_s) else 0
    if count < 1 or not math.isclose(count * timestep, step_s, rel_tol=1e-9):
        raise PlantError(f"a step of {step_s} s is not a multiple of the model's timestep, {timestep} s: change one of them")
    return count


def _checked_delay(delay: int) -> int:
    if delay < 0:
        raise PlantError("a delay is a number of steps, 0 or more")
    return delay


def _model_name(model: Any) -> str:
    return bytes(model.names).split(b"\0", 1)[0].decode() or "model"


def _joint_name(model: Any, joint: int) -> str:
    return _name(model, mujoco.mjtObj.mjOBJ_JOINT, joint, f"joint{joint + 1}")


def _name(model: Any, kind: Any, index: int, otherwise: str) -> str:
    return mujoco.mj_id2name(model, kind, index) or otherwise


def _warn(text: str) -> None:
    print(f"MuJoCo: {text}", file=sys.stderr)


def main() -> int:
    """The command line."""
    options = parser("A MuJoCo model as a plant.")
    options.add_argument("model", type=Path, help="MJCF file")
    options.add_argument("--step", type=float, required=True, metavar="S", help="how long a command is held, s")
    options.add_argument("--delay", type=int, default=0, metavar="STEPS", help="steps until a command acts")
    options.add_argument("--position-noise", type=float, default=0.0, metavar="RAD", help="standard deviation, rad or m")
    options.add_argument("--velocity-noise", type=float, default=0.0, metavar="RAD_S", help="the same, rad/s or m/s")
    options.add_argument("--encoder-step", type=float, default=0.0, metavar="RAD", help="step of the encoders, rad or m")
    options.add_argument("--rate", type=float, metavar="PER_S", help="fastest change of a command per second")
    options.add_argument("--speed", type=float, metavar="RAD_S", help="greatest speed of a joint, rad/s or m/s")
    given = options.parse_args()
    # By default MuJoCo writes its warnings to a file in the working folder.
    mujoco.set_mju_user_warning(_warn)

    def plant() -> MujocoPlant:
        sensors = Sensors(given.position_noise, given.velocity_noise, given.encoder_step)
        return MujocoPlant(
            given.model, step_s=given.step, delay=given.delay, sensors=sensors, rate=given.rate, speed=given.speed
        )

    return serve_at(plant, given.tcp)


if __name__ == "__main__":
    sys.exit(main())
