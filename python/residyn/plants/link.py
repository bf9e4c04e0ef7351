"""Lines to and from the host."""

import queue
import threading
from collections.abc import Callable
from enum import Enum

from .messages import LONGEST_LINE, Malformed

# How long a host may take to read the last lines, s, before the plant ends without it.
_FAREWELL_S = 2.0
# Lines that the host has not read, above which it counts as gone: memory is finite.
_MOST_UNREAD = 10_000


class HostGone(Exception):
    """The host ended, closed the connection or no longer reads."""


class _Event(Enum):
    ENDED = 1
    TOO_LONG = 2
    WOKEN = 3


class Link:
    """Lines to and from the host, by a thread each: a host that neither writes nor reads cannot hold up the plant's loop."""

    def __init__(self, read: Callable[[int], bytes], write: Callable[[bytes], object]) -> None:
        """
        Args:
            read: returns up to so many bytes, as soon as there are any; none at the end.
            write: writes all bytes.
        """
        self._read, self._write = read, write
        # SimpleQueue alone may be written to by a signal's handler while it is read.
        self._incoming: queue.SimpleQueue[bytes | _Event] = queue.SimpleQueue()
        self._outgoing: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
        self._writer = threading.Thread(target=self._write_all, daemon=True)
        threading.Thread(target=self._read_all, daemon=True).start()
        self._writer.start()

    def receive(self, timeout_s: float | None) -> bytes | None:
        """The next line without its end; None after the timeout, or if woken.

        Raises:
            HostGone: the host is gone.
            Malformed: a line that is too long.
        """
        try:
            event = self._incoming.get(timeout=timeout_s)
        except queue.Empty:
            return None
        if event is _Event.ENDED:
            raise HostGone
        if event is _Event.TOO_LONG:
            raise Malformed(f"a line is longer than {LONGEST_LINE} bytes")
        return event if isinstance(event, bytes) else None

    def send(self, line: bytes) -> None:
        """Send a line, without waiting.

        Raises:
            HostGone: the host does not read.
        """
        if self._outgoing.qsize() > _MOST_UNREAD:
            raise HostGone
        self._outgoing.put(line)

    def wake(self) -> None:
        """End the wait in `receive`; a signal's handler may call it."""
        self._incoming.put(_Event.WOKEN)

    def finish(self) -> None:
        """Wait until the host has what was sent, but not for long."""
        self._outgoing.put(None)
        self._writer.join(_FAREWELL_S)

    def _read_all(self) -> None:
        rest = b""
        while chunk := self._read_or_end():
            *lines, rest = (rest + chunk).split(b"\n")
            for line in lines:
                self._incoming.put(line if len(line) < LONGEST_LINE else _Event.TOO_LONG)
            if len(rest) >= LONGEST_LINE:
                self._incoming.put(_Event.TOO_LONG)
                return
        self._incoming.put(_Event.ENDED)

    def _read_or_end(self) -> bytes:
        try:
            return self._read(1 << 16)
        except OSError:
            return b""

    def _write_all(self) -> None:
        try:
            while (line := self._outgoing.get()) is not None:
                self._write(line)
        except OSError:
            self._incoming.put(_Event.ENDED)
