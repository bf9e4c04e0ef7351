"""Commands in shards, by any scheduler that calls functions: Dask, Ray, concurrent.futures.

    for number in range(1, 9):  # on as many machines, which share a file system
        run_shard(["bench", "effects"], "/shared/bench", number, 8)
    merge_shards(["bench", "effects"], "/shared/bench", 8)
"""

import os
import subprocess
import sys
import threading
from collections.abc import Sequence

from ._command import main
from ._residyn import ResidynError


def run_shard(
    command: Sequence[str], out: str | os.PathLike[str], number: int, of: int, *, threads: int = 1
) -> None:
    """Do one shard of a command in the folder OUT.parts/NUMBER, or what is left of it.

    It ends when this process does, however that ends. Run again, it resumes where it stopped.

    Args:
        command: words of the command line, without `residyn`, `--shard` and `--out`.
        out: folder of the whole run.
        number: which shard, counted from 1.
        of: number of shards.
        threads: how many to use.

    Raises:
        ResidynError: the shard could not be done, with the program's message.
    """
    _succeeds([*command, "--shard", f"{number}/{of}", "--out", _part(out, number)], threads)


def merge_shards(command: Sequence[str], out: str | os.PathLike[str], of: int, *, threads: int = 1) -> bool:
    """Put the shards of a command together, and write its results to the folder `out`.

    Args:
        command: as for `run_shard`.
        out: folder of the whole run.
        of: number of shards.
        threads: how many to use.

    Returns:
        Whether the answer of the command is yes: its exit status is 0, not 1.

    Raises:
        ResidynError: a shard that is missing or not finished, or results that cannot be written.
    """
    parts = [_part(out, number) for number in range(1, of + 1)]
    _succeeds(["merge", *parts, "--out", os.fspath(out)], threads)
    written = _run([*command, "--out", os.fspath(out)], threads)
    if written.returncode not in (0, 1):
        raise ResidynError(written.stderr)
    sys.stderr.write(written.stderr)
    return written.returncode == 0


def _part(out: str | os.PathLike[str], number: int) -> str:
    return f"{os.fspath(out)}.parts/{number}"


def _succeeds(arguments: Sequence[str], threads: int) -> None:
    done = _run(arguments, threads)
    if done.returncode != 0:
        raise ResidynError(done.stderr or f"residyn ended by signal {-done.returncode}")


def _run(arguments: Sequence[str], threads: int) -> "subprocess.CompletedProcess[str]":
    """The command in a process of its own, since it writes to the process's output and may end it."""
    words = [sys.executable, "-m", "residyn.shards", *arguments]
    environment = {**os.environ, "RAYON_NUM_THREADS": str(threads)}
    # The process reads from a pipe that nobody writes to: it sees its end when this process ends.
    reader, writer = os.pipe()
    try:
        return subprocess.run(words, stdin=reader, env=environment, capture_output=True, text=True, check=False)
    finally:
        os.close(reader)
        os.close(writer)


def _end_with_caller() -> None:
    os.read(sys.stdin.fileno(), 1)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_with_caller, daemon=True).start()
    sys.exit(main())
