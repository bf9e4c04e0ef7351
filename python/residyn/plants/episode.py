"""Episodes of a plant: which command acts when, on either clock."""

import math
import time
from collections.abc import Mapping, Sequence
from typing import Any

from .description import safe_command
from .guard import Guard
from .messages import Malformed, Reset, Step
from .plant import Array, Plant, PlantError, Row
from .record import SAFE, Acting, Record

Rows = Sequence[Mapping[str, Any]]


class SimulatedEpisode:
    """An episode of a plant that moves only in its steps."""

    def __init__(self, plant: Plant, reset: Reset) -> None:
        self._plant = plant
        self._guard = Guard(plant, safe_command(plant))
        self._record = Record(plant, self._guard)
        self._steps = 0
        self.first: Rows = [self._record.entry(plant.reset(reset.seed, reset.start), 0.0, SAFE)]

    def take(self, step: Step) -> Rows:
        """Do a step."""
        _check_id(step.id, self._steps)
        rows = _listed(self._plant.step(self._guard.admit(step.command)))
        begun_s = self._steps * self._plant.step_s
        self._steps = step.id
        # Rows without a time are evenly spaced.
        apart_s = self._plant.step_s / len(rows)
        acted = Acting(step.id)
        return [self._record.entry(row, begun_s + k * apart_s, acted) for k, row in enumerate(rows, start=1)]

    def due_s(self) -> float | None:
        """The plant waits for the host."""
        return None

    def tick(self) -> Rows:
        """Nothing happens by itself."""
        return []


class WallEpisode:
    """An episode of a plant that moves by itself: every period the newest command or, in the periods after it, the next of those
    that came with it, is applied, and rows are sent."""

    def __init__(self, plant: Plant, reset: Reset) -> None:
        self._plant = plant
        self._guard = Guard(plant, safe_command(plant))
        self._record = Record(plant, self._guard)
        first = plant.reset(reset.seed, reset.start)
        # Periods count from here, so that no delay adds up.
        self._begun_s = time.monotonic()
        self._period = 1
        self._newest: Step | None = None
        self._arrived = 0
        self._in_force = SAFE
        self.first: Rows = [self._record.entry(first, 0.0, SAFE)]

    def take(self, step: Step) -> Rows:
        """Keep the newest command for the end of the period."""
        _check_id(step.id, 0 if self._newest is None else self._newest.id)
        self._newest, self._arrived = step, self._period
        return []

    def due_s(self) -> float | None:
        """When the period ends, by the monotonic clock."""
        return self._begun_s + self._period * self._plant.step_s

    def tick(self) -> Rows:
        """End a period."""
        acted = self._in_force
        rows = _listed(self._plant.step(self._next_command()))
        now_s = time.monotonic() - self._begun_s
        # Periods that were missed are left out: made up for, they would come in a burst.
        self._period = max(self._period, math.floor(now_s / self._plant.step_s)) + 1
        if any(row.time is None for row in rows[:-1]):
            raise PlantError("several rows of one step, each need their time")
        return [self._record.entry(row, now_s, acted) for row in rows]

    def _next_command(self) -> Array:
        # The watchdog: whatever became of the host, its last command is not held for ever.
        silent = self._period - self._arrived
        if self._newest is None or silent >= self._plant.patience:
            self._in_force = SAFE
            return self._guard.rest()
        commands = [self._newest.command, *self._newest.next]
        self._in_force = Acting(self._newest.id, min(silent, len(commands) - 1))
        return self._guard.admit(commands[self._in_force.ahead])


Episode = SimulatedEpisode | WallEpisode


def begin(plant: Plant, reset: Reset) -> Episode:
    """Begin an episode on the plant's clock."""
    return SimulatedEpisode(plant, reset) if plant.clock == "simulated" else WallEpisode(plant, reset)


def _check_id(number: int, last: int) -> None:
    if number != last + 1:
        raise Malformed(f"step {number} follows step {last}: ids count up from 1 in each episode")


def _listed(rows: Row | Sequence[Row]) -> Sequence[Row]:
    listed = [rows] if isinstance(rows, Row) else rows
    if not listed:
        raise PlantError("a step returned no rows")
    return listed
