"""A conversation with a host, from its hello to its end, whatever that is."""

import signal
import sys
import time
import traceback
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from types import FrameType
from typing import Any

from .description import description
from .episode import Episode, Rows, begin
from .link import HostGone, Link
from .messages import Hello, Malformed, Message, Reset, Step, Stop, line_of, parse
from .plant import Plant, PlantError

# Of a period on the wall clock: a flood of messages must not keep the watchdog waiting.
_MOST_MESSAGES = 1000


class Interrupted(Exception):
    """SIGINT or SIGTERM arrived."""

    def __init__(self, number: int) -> None:
        super().__init__(f"interrupted by {signal.Signals(number).name}")
        self.number = number


class Interrupts:
    """Takes note of the first SIGINT or SIGTERM, to be acted on between two steps; the second acts as without it."""

    def __init__(self) -> None:
        self._received: int | None = None
        self.wake: Callable[[], None] = lambda: None
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._note)

    def check(self) -> None:
        """
        Raises:
            Interrupted: a signal has arrived.
        """
        if self._received is not None:
            raise Interrupted(self._received)

    def _note(self, number: int, frame: FrameType | None) -> None:
        self._received = number
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        self.wake()


@dataclass(frozen=True)
class Ending:
    """How a conversation ended.

    Attributes:
        said: the last message to the host; None if it is gone.
        status: exit status of a plant that ends with it.
        is_final: the plant cannot go on with another host.
    """

    said: Mapping[str, Any] | None
    status: int
    is_final: bool


def converse(plant: Plant, link: Link, interrupts: Interrupts) -> Ending:
    """Serve a host to the end; the plant is stopped however that comes, before the host is told."""
    interrupts.wake = link.wake
    ending = _stopped(plant, _ending(plant, link, interrupts))
    if ending.said is not None:
        with suppress(HostGone):
            link.send(line_of(ending.said))
    link.finish()
    return ending


def _ending(plant: Plant, link: Link, interrupts: Interrupts) -> Ending:
    try:
        _Conversation(plant, link, interrupts).run()
        return Ending({"type": "stopped"}, 0, False)
    except HostGone:
        return Ending(None, 0, False)
    except Malformed as error:
        return Ending(_error(str(error)), 1, False)
    except PlantError as error:
        return Ending(_error(str(error)), 1, False)
    except Interrupted as error:
        return Ending(_error(str(error)), 128 + error.number, True)
    # The code of the user may raise anything, SystemExit too.
    except BaseException as error:
        traceback.print_exc()
        return Ending(_error(f"{type(error).__name__}: {error}"), 1, True)


def _stopped(plant: Plant, ending: Ending) -> Ending:
    try:
        plant.stop()
        return ending
    except BaseException as error:
        traceback.print_exc()
        before = "" if ending.said is None else ending.said.get("message", "")
        failed = f"the plant could not be stopped and may move: {type(error).__name__}: {error}"
        return Ending(_error("; ".join(filter(None, [before, failed]))), ending.status or 1, True)


def _error(message: str) -> Mapping[str, Any]:
    print(f"error: {message}", file=sys.stderr)
    # Within a line, whatever the exception has to say.
    return {"type": "error", "message": message[:2000]}


class _Conversation:
    def __init__(self, plant: Plant, link: Link, interrupts: Interrupts) -> None:
        self._plant, self._link, self._interrupts = plant, link, interrupts
        self._episode: Episode | None = None
        self._messages = 0

    def run(self) -> None:
        """Until the host says stop."""
        if not isinstance(self._next(), Hello):
            raise Malformed("the first message is a hello")
        self._link.send(line_of(description(self._plant)))
        while not isinstance(message := self._next(), Stop):
            match message:
                case None:
                    self._tick()
                case Reset():
                    self._begin(message)
                case Step():
                    self._take(message)
                case Hello():
                    raise Malformed("a hello comes once")

    def _begin(self, reset: Reset) -> None:
        if self._episode is not None:
            self._plant.stop()
        self._messages = 0
        self._episode = begin(self._plant, reset)
        self._send(self._episode.first)

    def _take(self, step: Step) -> None:
        if self._episode is None:
            raise Malformed("a step comes after a reset")
        self._send(self._episode.take(step))

    def _tick(self) -> None:
        assert self._episode is not None
        self._messages = 0
        self._send(self._episode.tick())

    def _send(self, rows: Rows) -> None:
        if rows:
            self._link.send(line_of({"type": "rows", "rows": rows}))

    def _next(self) -> Message | None:
        """The next message; None at the end of a period."""
        while True:
            due_s = None if self._episode is None else self._episode.due_s()
            # Lines that wait are read even if the period is over, for the newest command to be applied.
            left_s = None if due_s is None else max(due_s - time.monotonic(), 0.0)
            line = self._link.receive(left_s)
            self._interrupts.check()
            if line is not None:
                self._count(due_s)
                return parse(line, len(self._plant.joints))
            if due_s is not None and time.monotonic() >= due_s:
                return None

    def _count(self, due_s: float | None) -> None:
        self._messages = 0 if due_s is None else self._messages + 1
        if self._messages > _MOST_MESSAGES:
            raise Malformed(f"more than {_MOST_MESSAGES} messages in a period")
