"""Keeps commands within a plant's limits, whatever the host sends."""

from collections.abc import Iterable

import numpy

from .limits import Interval
from .plant import Array, Plant


class Guard:
    """Clips commands in three steps: to the range, to the rate of change, and in the braking zone.

    A joint is in the braking zone of a limit of its angle if it is past the limit, or will be in `brake_s` at its present
    speed. There the command may push away from the limit or brake, never towards it: a torque stays on that side of the safe
    torque, a commanded position on that side of the measured one. Above its speed limit, a joint may only be braked, in the same
    way. Braking may exceed the rate: to be slow there would defeat it.
    """

    def __init__(self, plant: Plant, safe: Array) -> None:
        limits, joints = plant.limits, len(plant.joints)
        everywhere: list[Interval | None] = [None] * joints
        unlimited: list[float | None] = [None] * joints
        self._low, self._high = _ends(limits.command)
        self._change = _or_infinity(limits.rate or unlimited) * plant.step_s
        self._speed = _or_infinity(limits.speed or unlimited)
        self._angle_low, self._angle_high = _ends(limits.angle or everywhere)
        self._brake_s = limits.brake_s
        self._is_position = plant.command == "position"
        self._safe = self._last = safe
        self._q = self._qd = numpy.zeros(joints)
        self._time: float | None = None

    def observe(self, time: float, q: Array, qd: Array | None) -> None:
        """Take note of a row; velocities that were not measured are differences of positions."""
        if self._time is None and self._is_position:
            # Positions are commanded from where the joints are, wherever the safe one is.
            self._last = numpy.clip(q, self._low, self._high)
        if qd is not None:
            self._qd = qd
        elif self._time is not None:
            self._qd = (q - self._q) / (time - self._time)
        self._time, self._q = time, q

    def admit(self, command: Array) -> Array:
        """The command nearest to what is asked that may be applied now."""
        admitted = numpy.clip(command, self._low, self._high)
        admitted = numpy.clip(admitted, self._last - self._change, self._last + self._change)
        self._last = numpy.clip(self._braking(admitted), self._low, self._high)
        return self._last

    def rest(self) -> Array:
        """The safe command: a torque at once, a position as fast as the rate allows."""
        if self._is_position:
            return self.admit(self._safe)
        self._last = self._safe
        return self._last

    def _braking(self, command: Array) -> Array:
        ahead = self._q + self._brake_s * self._qd
        nears_high = (numpy.maximum(self._q, ahead) > self._angle_high) | (self._qd > self._speed)
        nears_low = (numpy.minimum(self._q, ahead) < self._angle_low) | (self._qd < -self._speed)
        neutral = self._q if self._is_position else self._safe
        command = numpy.where(nears_high, numpy.minimum(command, neutral), command)
        return numpy.where(nears_low, numpy.maximum(command, neutral), command)


def _ends(intervals: Iterable[Interval | None]) -> tuple[Array, Array]:
    ends = [(-numpy.inf, numpy.inf) if interval is None else interval for interval in intervals]
    return numpy.array([low for low, _ in ends]), numpy.array([high for _, high in ends])


def _or_infinity(limits: Iterable[float | None]) -> Array:
    return numpy.array([numpy.inf if limit is None else limit for limit in limits])
