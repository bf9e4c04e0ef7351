"""Messages of the protocol; docs/plants.md explains them, docs/plants.schema.json defines them."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NoReturn

import numpy

from .plant import Array

PROTOCOL = 1
# In bytes, with the end of the line. JSON numbers are doubles for some hosts: hence the largest integer.
LONGEST_LINE = 1_000_000
LARGEST_INTEGER = 2**53 - 1


class Malformed(Exception):
    """A message that breaks the protocol."""


@dataclass(frozen=True)
class Hello:
    """The host speaks the protocol."""


@dataclass(frozen=True)
class Reset:
    """An episode begins.

    Attributes:
        seed: of everything random in it.
        start: positions, then velocities, shape (2 joints,); None for the plant's own start.
    """

    seed: int
    start: Array | None


@dataclass(frozen=True)
class Step:
    """A command.

    Attributes:
        id: counts up from 1 within an episode.
        command: of each joint, shape (joints,).
        next: commands for the periods after it, while nothing newer has come, each of shape (joints,).
    """

    id: int
    command: Array
    next: Sequence[Array] = ()


@dataclass(frozen=True)
class Stop:
    """The plant is no longer needed."""


Message = Hello | Reset | Step | Stop


def parse(line: bytes, joints: int) -> Message:
    """Read a line from the host.

    Args:
        line: without the end of the line.
        joints: how many the plant has.

    Raises:
        Malformed: whatever is not a message to such a plant.
    """
    message = _json(line)
    if not isinstance(message, dict):
        raise Malformed("a message is a JSON object")
    match message.get("type"):
        case "hello":
            return _hello(message)
        case "reset":
            start = message.get("start")
            seed = _integer(message, "seed", 0)
            return Reset(seed, None if start is None else _numbers("start", start, 2 * joints))
        case "step":
            command = _numbers("command", message.get("command"), joints)
            return Step(_integer(message, "id", 1), command, _next(message.get("next", []), joints))
        case "stop":
            return Stop()
        case other:
            raise Malformed(f"messages to a plant are of type hello, reset, step or stop, not {_shown(other)}")


def line_of(message: Mapping[str, Any]) -> bytes:
    """A message to the host as its line.

    Raises:
        ValueError: a number that is not finite, or a line that is too long.
    """
    line = json.dumps(message, allow_nan=False, separators=(",", ":")).encode() + b"\n"
    if len(line) > LONGEST_LINE:
        raise ValueError(f"a message of {len(line)} bytes is longer than {LONGEST_LINE}: return fewer rows from one step")
    return line


def _json(line: bytes) -> Any:
    try:
        return json.loads(line.decode(), parse_constant=_refused)
    except (ValueError, RecursionError) as error:
        raise Malformed(f"a line is not JSON in UTF-8: {error}") from None


def _refused(constant: str) -> NoReturn:
    raise Malformed(f"{constant} is not a finite number")


def _hello(message: Mapping[str, Any]) -> Hello:
    if message.get("protocol") != PROTOCOL:
        raise Malformed(f"this plant speaks protocol {PROTOCOL}, not {_shown(message.get('protocol'))}")
    return Hello()


def _integer(message: Mapping[str, Any], name: str, least: int) -> int:
    value = message.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= LARGEST_INTEGER:
        raise Malformed(f'"{name}" is an integer from {least} to {LARGEST_INTEGER}, not {_shown(value)}')
    return value


def _next(commands: object, joints: int) -> Sequence[Array]:
    if not isinstance(commands, list):
        raise Malformed(f'"next" is a list of commands, not {_shown(commands)}')
    return [_numbers("next", command, joints) for command in commands]


def _numbers(name: str, values: object, count: int) -> Array:
    if not isinstance(values, list) or len(values) != count:
        raise Malformed(f'"{name}" is a list of {count} numbers, not {_shown(values)}')
    return numpy.array([_number(name, value) for value in values])


def _number(name: str, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise Malformed(f'"{name}" holds {_shown(value)}, which is not a number')
    # 1e999 is JSON and not finite; an integer may be too large for a double.
    if isinstance(value, int) and abs(value) > LARGEST_INTEGER or not math.isfinite(value):
        raise Malformed(f'"{name}" holds a number that is not finite or too large')
    return float(value)


def _shown(value: object) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else text[:57] + "..."
