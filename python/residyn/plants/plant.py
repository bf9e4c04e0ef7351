"""What a program of the user's own says and does to be a plant."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy
from numpy.typing import NDArray

from .limits import Limits

Array = NDArray[numpy.float64]
Numbers = Sequence[float] | Array


class PlantError(ValueError):
    """A plant that cannot be served, or cannot do what it is asked."""


@dataclass(frozen=True)
class Row:
    """What is measured at one moment.

    Attributes:
        q: positions in rad (or m), one for each joint.
        qd: velocities in rad/s (or m/s), if they are measured.
        tau: torques in N m (or forces in N) that acted up to this moment, if they are known.
        time: s since the reset by the plant's own clock; without it, the time at which the row is handed over.
        measured: further values by their names in `Plant.measured`.
    """

    q: Numbers
    qd: Numbers | None = None
    tau: Numbers | None = None
    time: float | None = None
    measured: Mapping[str, float] = field(default_factory=dict)


class Plant:
    """A rig or a simulator: derive from it, and give the result to `serve`.

    Attributes:
        name: for people.
        joints: their names, in the order of all numbers.
        step_s: how long a command is held, s.
        limits: what may be asked; commands are kept within them whatever the host sends.
        command: what a command is: a torque in N m (or N), or a position in rad (or m).
        clock: "simulated": moves only in `step`; "wall": moves by itself, and `step` is called every `step_s`.
        safe: the command that is safe to hold; by default no torque.
        patience: periods of silence after which a plant on the wall clock gets its safe command; until then it gets those that
            the host sent ahead.
        measured: names of further values in rows.
    """

    name: str
    joints: Sequence[str]
    step_s: float
    limits: Limits
    command: Literal["torque", "position"] = "torque"
    clock: Literal["simulated", "wall"] = "simulated"
    safe: Numbers | None = None
    patience: int = 5
    measured: Sequence[str] = ()

    def reset(self, seed: int, start: Array | None) -> Row:
        """Begin an episode.

        Args:
            seed: of everything random in it.
            start: positions, then velocities, shape (2 joints,); None for the plant's own start.

        Returns:
            The first row.

        Raises:
            PlantError: a start that the plant cannot take.
        """
        raise NotImplementedError

    def step(self, command: Array) -> Row | Sequence[Row]:
        """Apply a command that is within the limits.

        On the simulated clock, hold it for `step_s`. On the wall clock, read the sensors, pass the command on, and return at
        once: a call that waits holds up the watchdog, so give every device a timeout.

        Args:
            command: of each joint, shape (joints,).

        Returns:
            What was measured since the last call, the newest row last.
        """
        raise NotImplementedError

    def stop(self) -> None:
        """Hold the safe command without help from this program: motors off, say.

        Called at the end of every episode, however it ends, and perhaps more than once; `reset` may follow. A plant on the wall
        clock must have it; a simulated one stands still anyway.
        """
