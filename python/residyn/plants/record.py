"""The rows of an episode, checked before they are sent."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy

from .guard import Guard
from .plant import Array, Numbers, Plant, PlantError, Row


@dataclass(frozen=True)
class Acting:
    """What acts on a plant.

    Attributes:
        id: of the command; 0 for the safe one.
        ahead: how many of its next ones were applied since.
    """

    id: int
    ahead: int = 0


SAFE = Acting(0)


class Record:
    """Turns rows of a plant into those of a message, and shows them to its guard."""

    def __init__(self, plant: Plant, guard: Guard) -> None:
        self._joints, self._measured = len(plant.joints), set(plant.measured)
        self._guard = guard
        self._time = -numpy.inf

    def entry(self, row: Row, handed_over_s: float, in_force: Acting) -> Mapping[str, Any]:
        """A row of a message.

        Args:
            row: as the plant returned it.
            handed_over_s: time of a row that has none, s since the reset.
            in_force: what acted up to the row.

        Raises:
            PlantError: a number that is not finite, of the wrong shape or under an unknown name; time that does not increase.
        """
        time = self._later(handed_over_s if row.time is None else row.time)
        q, qd, tau = self._numbers("q", row.q), self._optional("qd", row.qd), self._optional("tau", row.tau)
        self._guard.observe(time, q, qd)
        optional = {"qd": qd, "tau": tau}
        entry: dict[str, Any] = {"time": time, "q": q.tolist()}
        entry |= {name: values.tolist() for name, values in optional.items() if values is not None}
        entry["command"] = in_force.id
        if in_force.ahead:
            entry["ahead"] = in_force.ahead
        return {**entry, "measured": self._further(row.measured)} if row.measured else entry

    def _later(self, time: float) -> float:
        if not (numpy.isfinite(time) and time > self._time):
            raise PlantError(f"the plant's time went from {self._time} s to {time} s: it increases from row to row")
        self._time = float(time)
        return self._time

    def _optional(self, name: str, values: Numbers | None) -> Array | None:
        return None if values is None else self._numbers(name, values)

    def _numbers(self, name: str, values: Numbers) -> Array:
        numbers = numpy.array(values, float)
        if numbers.shape != (self._joints,):
            raise PlantError(f"{name} of a row has the shape {numbers.shape}, not ({self._joints},)")
        if not numpy.isfinite(numbers).all():
            raise PlantError(f"{name} of a row is {numbers.tolist()}: not finite")
        return numbers

    def _further(self, measured: Mapping[str, float]) -> Mapping[str, float]:
        if unknown := set(measured) - self._measured:
            raise PlantError(f"values {sorted(unknown)} of a row are not among the names in `measured`")
        if not numpy.isfinite(list(measured.values())).all():
            raise PlantError(f"a value of a row is not finite: {dict(measured)}")
        return {name: float(value) for name, value in measured.items()}
