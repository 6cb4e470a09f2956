"""The command line: ``python -m biscale render fig4b_bicolor_cup -o cup.png``."""

from __future__ import annotations

import signal
import sys

from ._core import _main


def main() -> int:
    """Runs the command line of this process and returns its exit code."""
    # The program ends at Ctrl-C without a traceback.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _main(["biscale", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
