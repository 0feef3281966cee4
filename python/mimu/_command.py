"""The command ``mimu``."""

from __future__ import annotations

import signal
import sys

from mimu import _mimu


def main() -> int:
    """Runs the command with the arguments of the process."""
    # Python's handler only sets a flag for the interpreter, which does not run during the call.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _mimu.run(sys.argv)


if __name__ == "__main__":
    raise SystemExit(main())
