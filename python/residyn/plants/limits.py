"""What may be asked of a plant."""

from collections.abc import Sequence
from dataclasses import dataclass

Interval = tuple[float, float]


@dataclass(frozen=True)
class Limits:
    """What may be asked of a plant, with an entry for each joint; None where a joint has no such limit.

    Attributes:
        command: least and greatest command in N m (or N), or rad (or m) for position commands.
        rate: fastest change of the command per second.
        speed: greatest speed in rad/s (or m/s), above which a command may only brake.
        angle: least and greatest position in rad (or m).
        brake_s: how far ahead in s a joint is seen to pass a limit of its angle at the speed that it has.
    """

    command: Sequence[Interval]
    rate: Sequence[float | None] | None = None
    speed: Sequence[float | None] | None = None
    angle: Sequence[Interval | None] | None = None
    brake_s: float = 0.1
