"""The command ``groundmap``: exit 0 done, 1 a bound missed, 2 bad input or usage, 3 no route.

130 and 143 after SIGINT (Ctrl-C) and SIGTERM: one line on stderr, at any time, and no process is
left behind. What takes time to load is loaded after their handlers are set.
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
    """What happens on SIGINT and SIGTERM.

    While a command runs, the first raises KeyboardInterrupt, so that files which are half written
    are removed. Before and after, and at the second, the process ends at once.
    """

    def __init__(self) -> None:
        self.running = False
        self.received = 0  #: number of the signal; 0 for none
        self._before: dict[int, Any] = {}

    def set_handlers(self) -> None:
        """Handle the signals, but for those that the caller wants ignored (as nohup does)."""
        if threading.current_thread() is not threading.main_thread():
            return
        for number in WORDS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                self._before[number] = signal.signal(number, self._handle)
        sys.unraisablehook = self._unraisable

    def restore_handlers(self) -> None:
        """Have the signals handled as before."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
        sys.unraisablehook = sys.__unraisablehook__

    def leave(self) -> None:
        """End the process and those that it started, with a line on stderr."""
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
        """Leave where an interrupt is raised in what can't raise, such as a destructor."""
        if self.received and unraisable.exc_type is KeyboardInterrupt:
            self.leave()
        sys.__unraisablehook__(unraisable)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command and exit.

    Parameters
    ----------
    arguments : sequence of str, optional
        The process's own unless given. With arguments, the signals are handled as before once
        the command has ended.
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
        # Whatever came out of the command then: libraries turn interrupts into other exceptions.
        if interrupts.received:
            interrupts.leave()
