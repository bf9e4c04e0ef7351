"""The command `residyn`."""

import signal
import sys

from ._residyn import main as run


def main() -> int:
    """Run the program on the arguments of this process, and return its exit status."""
    # Ctrl-C is the program's own business, as it is without Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return run(["residyn", *sys.argv[1:]])
