"""Gymnasium environments with continuous actions as plants; needs `pip install residyn[plants]`.

    python -m residyn.plants.gymnasium Pendulum-v1

serves Gymnasium's own equations of Pendulum-v1, Acrobot-v1 or CartPole-v1 with continuous torques or forces; see `READY`. Any
other environment is a few lines with `GymnasiumPlant`.
"""

import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy

from .limits import Limits
from .plant import Array, Numbers, Plant, PlantError, Row
from .serve import parser, serve_at

Env = gymnasium.Env[Any, Any]


class GymnasiumPlant(Plant):
    """A Gymnasium environment as a plant on the simulated clock.

    Rewards are ignored. Neither termination nor a time limit ends an episode, the host does: hence the environment is stepped
    without the wrappers of `gymnasium.make`.
    """

    def __init__(
        self,
        env: Env,
        *,
        name: str,
        joints: Sequence[str],
        step_s: float,
        limits: Limits,
        measure: Callable[[Any, Array], Row],
        act: Callable[[Env, Array], Any] | None = None,
        begin: Callable[[Env, Array], Any] | None = None,
        turns: Sequence[bool] | None = None,
        safe: Numbers | None = None,
    ) -> None:
        """
        Args:
            env: the environment.
            name: for people.
            joints: names of the joints.
            step_s: how long the environment holds an action, s.
            limits: what may be asked.
            measure: makes a row of an observation and of the command that led to it.
            act: makes an action of a command; without it, the range of each command is scaled to that of the action.
            begin: sets positions, then velocities, after a reset, and returns the observation; without it, a host cannot choose
                the start.
            turns: whether a joint's position is an angle that the environment wraps, to be counted on over full turns.
            safe: the command that is safe to hold; by default no torque.
        """
        self.name, self.joints, self.step_s, self.limits, self.safe = name, joints, step_s, limits, safe
        self._env = env.unwrapped
        self._measure, self._begin = measure, begin
        self._act = act or _scaling(self._env, limits)
        self._turns = numpy.array(turns or [False] * len(joints))
        self._q: Array | None = None

    def reset(self, seed: int, start: Array | None) -> Row:
        """Begin at the start of the environment, or at the given one."""
        observation, _ = self._env.reset(seed=seed)
        if start is not None:
            if self._begin is None:
                raise PlantError(f"{self.name} begins where it chooses: reset it without a start")
            observation = self._begin(self._env, start)
        # A start may be several turns away; without one, angles are those of the environment.
        self._q = None if start is None else start[: len(self.joints)]
        return self._unwrapped(self._measure(observation, numpy.zeros(len(self.joints))))

    def step(self, command: Array) -> Row:
        """Hold a command for one step of the environment."""
        observation, *_ = self._env.step(self._act(self._env, command))
        return self._unwrapped(self._measure(observation, command))

    def _unwrapped(self, row: Row) -> Row:
        q = numpy.array(row.q, float)
        if self._q is not None:
            turn = 2 * math.pi
            q = numpy.where(self._turns, q + turn * numpy.round((self._q - q) / turn), q)
        self._q = q
        return Row(q=q, qd=row.qd, tau=row.tau, time=row.time, measured=row.measured)


def _scaling(env: Env, limits: Limits) -> Callable[[Env, Array], Array]:
    space = env.action_space
    if not isinstance(space, gymnasium.spaces.Box):
        raise PlantError(f"the actions of {env} are not continuous: say with `act` how it takes a torque")
    low, high = numpy.array(limits.command, float).T
    if space.shape != low.shape or not (numpy.isfinite(space.low).all() and numpy.isfinite(space.high).all()):
        raise PlantError(f"the actions of {env} are {space}, not one bounded number a joint: say with `act` what they are")
    width = numpy.where(high > low, high - low, 1.0)
    return lambda _, command: (space.low + (command - low) / width * (space.high - space.low)).astype(space.dtype)


def pendulum(step_s: float = 0.05) -> GymnasiumPlant:
    """Pendulum-v1: a rod of 1 kg and 1 m; torques of 2 N m at most cannot lift it at once.

    q = 0 stands upright, pi hangs; positive is counter-clockwise. The environment clips speeds to 8 rad/s.
    """
    env = _made("Pendulum-v1")
    env.dt = step_s
    return GymnasiumPlant(
        env,
        name="Pendulum-v1 of Gymnasium",
        joints=["pivot"],
        step_s=step_s,
        limits=Limits(command=[(-env.max_torque, env.max_torque)]),
        measure=lambda seen, command: Row(q=[math.atan2(seen[1], seen[0])], qd=[seen[2]], tau=command),
        begin=_begin_pendulum,
        turns=[True],
    )


def acrobot(step_s: float = 0.02) -> GymnasiumPlant:
    """Acrobot-v1 with any torque between -1 and 1 N m at the elbow, where Gymnasium has three.

    Its equations are those of the book; the table of its torques is written anew in every step. q = 0 hangs down, the elbow's
    angle is relative to the first link. The environment clips speeds to 4 pi and 9 pi rad/s. Gymnasium's step is 0.2 s, in which
    the elbow may turn by more than half a turn, so that its angle is lost: it has to be shorter than 0.1 s.
    """
    if not step_s < 0.1:
        raise PlantError(f"a step of {step_s} s is too long to follow the acrobot's elbow: at most 0.1 s")
    env = _made("Acrobot-v1")
    env.dt = step_s
    return GymnasiumPlant(
        env,
        name="Acrobot-v1 of Gymnasium, with a continuous torque",
        joints=["shoulder", "elbow"],
        step_s=step_s,
        limits=Limits(command=[(0.0, 0.0), (min(env.AVAIL_TORQUE), max(env.AVAIL_TORQUE))]),
        measure=_measure_acrobot,
        act=_act_acrobot,
        begin=_begin_acrobot,
        turns=[True, True],
    )


def cartpole(step_s: float = 0.02) -> GymnasiumPlant:
    """CartPole-v1 with any force between -10 and 10 N on the cart, where Gymnasium has two.

    Its equations are Gymnasium's, explicit Euler steps included; the size of its force is written anew in every step. The cart's
    position in m is 0 in the middle of a track of 4.8 m; the pole's angle 0 stands upright, positive is clockwise.
    """
    env = _made("CartPole-v1")
    env.tau = step_s
    return GymnasiumPlant(
        env,
        name="CartPole-v1 of Gymnasium, with a continuous force",
        joints=["cart", "pole"],
        step_s=step_s,
        limits=Limits(
            command=[(-env.force_mag, env.force_mag), (0.0, 0.0)], angle=[(-env.x_threshold, env.x_threshold), None]
        ),
        measure=lambda seen, command: Row(q=[seen[0], seen[2]], qd=[seen[1], seen[3]], tau=command),
        act=_act_cartpole,
        begin=_begin_cartpole,
    )


@dataclass(frozen=True)
class Ready:
    """An environment that is ready to be served.

    Attributes:
        make: makes the plant from the length of its step in s.
        step_s: the length by default.
    """

    make: Callable[[float], GymnasiumPlant]
    step_s: float


READY = {
    "Pendulum-v1": Ready(pendulum, 0.05),
    "Acrobot-v1": Ready(acrobot, 0.02),
    "CartPole-v1": Ready(cartpole, 0.02),
}


def _made(name: str) -> Any:
    """The bare environment, whose attributes Gymnasium does not type."""
    return gymnasium.make(name).unwrapped


def _begin_pendulum(env: Any, start: Array) -> Any:
    env.state = numpy.array(start)
    return env._get_obs()


def _measure_acrobot(seen: Array, command: Array) -> Row:
    return Row(q=[math.atan2(seen[1], seen[0]), math.atan2(seen[3], seen[2])], qd=seen[4:], tau=command)


def _act_acrobot(env: Any, command: Array) -> int:
    env.AVAIL_TORQUE = [float(command[1])] * 3
    return 0


def _begin_acrobot(env: Any, start: Array) -> Any:
    env.state = numpy.array(start)
    return env._get_ob()


def _act_cartpole(env: Any, command: Array) -> int:
    # Past its thresholds the environment warns that an episode should end, and moves on all the same.
    env.steps_beyond_terminated = None
    env.force_mag = float(command[0])
    return 1


def _begin_cartpole(env: Any, start: Array) -> Any:
    x, angle, speed, rate = start
    env.state = numpy.array([x, speed, angle, rate])
    return numpy.array(env.state, numpy.float32)


def main() -> int:
    """The command line."""
    options = parser("A Gymnasium environment as a plant.")
    options.add_argument("environment", choices=sorted(READY))
    options.add_argument("--step", type=float, metavar="S", help="how long a command is held, s")
    given = options.parse_args()
    ready = READY[given.environment]
    return serve_at(lambda: ready.make(given.step or ready.step_s), given.tcp)


if __name__ == "__main__":
    sys.exit(main())
