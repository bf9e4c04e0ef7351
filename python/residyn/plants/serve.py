"""A plant at the end of a pipe, or of a TCP connection."""

import argparse
import os
import socket
import sys
from collections.abc import Callable, Sequence

from .conversation import Interrupted, Interrupts, converse
from .description import description
from .link import Link
from .plant import Plant, PlantError

# How often a plant without a host looks for signals, s.
_LOOK_S = 0.2


def parser(about: str) -> argparse.ArgumentParser:
    """A command line with the options of every plant."""
    made = argparse.ArgumentParser(description=about)
    made.add_argument("--tcp", metavar="HOST:PORT", help="listen there instead of standard input; port 0 is any free one")
    return made


def serve(plant: Plant, arguments: Sequence[str] | None = None) -> int:
    """Do what a host asks for, on standard input and output or, with `--tcp HOST:PORT`, for one host after another.

    Standard output is for messages alone: whatever the plant prints goes to standard error. The plant is stopped when a host
    says so or ends, at an error, and by SIGINT and SIGTERM. To be called from the main thread.

    Args:
        plant: to be served.
        arguments: of the command line; by default those of this process.

    Returns:
        The exit status.
    """
    return serve_at(lambda: plant, parser(plant.name).parse_args(arguments).tcp)


def serve_at(make: Callable[[], Plant], address: str | None) -> int:
    """Serve on standard input and output, or on a TCP address.

    Args:
        make: makes the plant to be served; a plant that cannot be is reported.
        address: HOST:PORT, or PORT for this machine alone; None for standard input and output.

    Returns:
        The exit status.
    """
    try:
        plant = make()
        description(plant)
        where = None if address is None else _address(address)
    except PlantError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return _serve_pipe(plant) if where is None else _serve_tcp(plant, *where)


def _serve_pipe(plant: Plant) -> int:
    interrupts = Interrupts()
    return converse(plant, _pipe(), interrupts).status


def _pipe() -> Link:
    """Keeps standard input and output for the protocol alone; prints, also those of libraries in C, go to standard error."""
    source, sink = os.dup(0), os.dup(1)
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    sys.stdout.flush()
    os.dup2(2, 1)
    return Link(lambda most: os.read(source, most), lambda line: _write_all(sink, line))


def _write_all(sink: int, line: bytes) -> None:
    while line:
        line = line[os.write(sink, line) :]


def _serve_tcp(plant: Plant, host: str, port: int) -> int:
    interrupts = Interrupts()
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    try:
        server = socket.create_server((host, port), family=family)
    except OSError as error:
        print(f"error: cannot listen on {host} port {port}: {error}", file=sys.stderr)
        return 2
    with server:
        server.settimeout(_LOOK_S)
        print(f"listening on {host} port {server.getsockname()[1]}", file=sys.stderr, flush=True)
        try:
            return _serve_hosts(plant, server, interrupts)
        except Interrupted as error:
            return 128 + error.number


def _serve_hosts(plant: Plant, server: socket.socket, interrupts: Interrupts) -> int:
    while True:
        with _next_host(server, interrupts) as client:
            # Commands are small and late ones useless: they do not wait to be sent together.
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            ending = converse(plant, Link(client.recv, client.sendall), interrupts)
            _hang_up(client)
        if ending.is_final:
            return ending.status


def _next_host(server: socket.socket, interrupts: Interrupts) -> socket.socket:
    while True:
        interrupts.check()
        try:
            client, _ = server.accept()
        except TimeoutError:
            continue
        client.settimeout(None)
        return client


def _hang_up(client: socket.socket) -> None:
    """Ends the thread that reads, too; the host may have done so already."""
    try:
        client.shutdown(socket.SHUT_RDWR)
    except OSError:
        pass


def _address(text: str) -> tuple[str, int]:
    host, _, port = text.rpartition(":")
    if not port.isdecimal() or int(port) > 65535:
        raise PlantError(f'"{text}" is not HOST:PORT')
    return host.strip("[]") or "127.0.0.1", int(port)
