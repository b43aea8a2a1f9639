"""The command ``groundmap``: exit 0 done, 1 a bound missed, 2 bad input or usage, 3 no route.

SIGINT (Ctrl-C) and SIGTERM end it at any time with code 130 or 143, one line on stderr, and
without leftover processes. Slow imports come after the signal handlers are set.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Sequence
from types import FrameType
from typing import Any

WORDS = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}


class _Interrupts:
    """Handling of SIGINT and SIGTERM.

    While a command runs, the first signal raises KeyboardInterrupt, so that partly written files
    are removed. Before and after a command, and at the second signal, the process ends at once.
    """

    def __init__(self) -> None:
        self.running = False
        self.received = 0  #: number of the signal; 0 for none
        self._previous: dict[int, Any] = {}

    def set_handlers(self) -> None:
        """Set handlers for the signals that the parent process does not ignore (as nohup does)."""
        if threading.current_thread() is not threading.main_thread():
            return
        for number in WORDS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._previous[number] = signal.signal(number, self._handle)
        sys.unraisablehook = self._unraisable

    def restore_handlers(self) -> None:
        """Restore the previous signal handlers."""
        for number, handler in self._previous.items():
            signal.signal(number, handler)
        sys.unraisablehook = sys.__unraisablehook__

    def leave(self) -> None:
        """End this process and its child processes, with one line on stderr."""
        if "multiprocessing" in sys.modules:
            for child in sys.modules["multiprocessing"].active_children():
                child.kill()
        number = signal.Signals(self.received)
        os.write(2, f"groundmap: {WORDS[number]}\n".encode())
        os._exit(128 + number)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        first, self.received = not self.received, number
        if not (self.running and first):
            self.leave()
        raise KeyboardInterrupt

    def _unraisable(self, unraisable: Any) -> None:
        """End the process if an interrupt is raised in code that can't raise: a destructor."""
        if self.received and unraisable.exc_type is KeyboardInterrupt:
            self.leave()
        sys.__unraisablehook__(unraisable)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and exit.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: those of the process. With arguments, the previous signal handlers are restored
        when the command has ended.
    """
    interrupts = _Interrupts()
    interrupts.set_handlers()
    try:
        code = _run(interrupts, sys.argv[1:] if arguments is None else arguments)
    finally:
        if arguments is not None:
            interrupts.restore_handlers()
    sys.exit(code)


def _run(interrupts: _Interrupts, argv: Sequence[str]) -> int:
    from planners.commands.app import run

    try:
        interrupts.running = True
        return run(list(argv))
    except KeyboardInterrupt:
        interrupts.received = interrupts.received or signal.SIGINT
        raise
    finally:
        interrupts.running = False
        # Also after other exceptions: some libraries replace KeyboardInterrupt by their own.

        if interrupts.received:
            interrupts.leave()
