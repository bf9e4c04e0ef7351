"""The command `residyn`."""

import signal
import sys

from . import _residyn


def main() -> int:
    """Run the program on the arguments of this process, and return its exit status."""
    # Ctrl-C is the program's own business, as it is without Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _residyn.main(_residyn.__file__, ["residyn", *sys.argv[1:]])
