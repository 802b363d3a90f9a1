"""The program `splatblur` of the wheel. It is the program of the crate, compiled into `_native`."""

from __future__ import annotations

import os
import signal
import sys

from . import _native


def main() -> None:
    """Runs the program with the arguments of this process, and ends with its exit status."""
    if "XDG_RUNTIME_DIR" not in os.environ:
        # The program would start itself anew to set this (src/cli/selection.rs); here it can be set before.
        os.environ.setdefault("NODEVICE_SELECT", "1")
    # As in a program of its own: Ctrl-C ends it until it watches for Ctrl-C by itself.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    status = _native.main(["splatblur", *sys.argv[1:]])
    sys.stdout.flush()
    # Without the interpreter's end: nothing of Python is left to do.
    os._exit(status)
