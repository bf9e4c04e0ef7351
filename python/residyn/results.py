"""Results with names; each unpacks like a tuple."""

from typing import NamedTuple

import numpy
from numpy.typing import NDArray

_Array = NDArray[numpy.float64]


class Prediction(NamedTuple):
    """One window of an open-loop prediction.

    Attributes:
        time: time of each row in s, shape (rows,), on the log's time axis.
        q: predicted joint angles in rad (or m), shape (rows, joints).
    """

    time: _Array
    q: _Array


class Torques(NamedTuple):
    """The torques of a motion, low-passed, on even steps of time.

    Attributes:
        time: time of each row in s, shape (rows,).
        logged: what the log holds in N m (or N), shape (rows, joints).
        needed: what the motion needs according to the model in N m (or N), shape (rows, joints).
    """

    time: _Array
    logged: _Array
    needed: _Array


class Step(NamedTuple):
    """A step of a simulated rig.

    Attributes:
        state: what is measured after the step: positions, then velocities, shape (2 joints,).
        reward: of the step, by the task.
    """

    state: _Array
    reward: float


class Bounds(NamedTuple):
    """What may be commanded.

    Attributes:
        low: least torque in N m (or N) or command of each joint, shape (joints,).
        high: greatest, shape (joints,).
    """

    low: _Array
    high: _Array
