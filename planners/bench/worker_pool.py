"""Work done by processes: one that crashes or hangs loses what it had in hand, and no more."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections import deque
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")

TICK = 1.0  # [s] between two looks at who is overdue


class _Worker(Generic[T, R]):
    """One process, and what it has in hand."""

    task: T
    due: float

    def __init__(self, act: Callable[[T], R]) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(theirs, act), daemon=True)
        resource_tracker.ensure_running()  # its own start would let Ctrl-C through again
        # Ctrl-C in a terminal is sent to all: it is for the process that the others work for.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            self.process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        theirs.close()

    def give(self, task: T, patience: float) -> None:
        """Hand over a task."""
        self.task, self.due = task, time.monotonic() + patience
        with suppress(OSError):  # it has ended, which its pipe tells whoever waits for it
            self.pipe.send(task)

    @property
    def is_overdue(self) -> bool:
        """Whether it has had its task for too long."""
        return time.monotonic() >= self.due

    def dismiss(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


def worker_pool(
    tasks: Iterable[T],
    act: Callable[[T], R],
    *,
    jobs: int,
    patience: float,
    lost: Callable[[T, str], R],
) -> Generator[tuple[T, R]]:
    """Yield tasks with their results, as they come in.

    Parameters
    ----------
    tasks : iterable
        Each can be pickled.
    act : callable
        A function of a module, that other processes can import.
    jobs : int
        How many processes work at the same time.
    patience : float [s]
        A process that takes longer over a task is ended.
    lost : callable
        Makes the result of a task whose process ended, of the task and what happened.
    """
    left = deque(tasks)
    hands: list[_Worker[T, R]] = []
    try:
        while left or hands:
            while left and len(hands) < jobs:
                hands.append(_Worker(act))
                hands[-1].give(left.popleft(), patience)
            ready = wait([hand.pipe for hand in hands], timeout=TICK)
            for hand in [hand for hand in hands if hand.pipe in ready or hand.is_overdue]:
                task = hand.task
                result, fit = _result(hand, lost, patience)
                if fit and left:
                    hand.give(left.popleft(), patience)
                else:
                    hands.remove(hand)
                    hand.dismiss()
                yield task, result
    finally:
        for hand in hands:
            hand.dismiss()


def _result(hand: _Worker[T, R], lost: Callable[[T, str], R], patience: float) -> tuple[R, bool]:
    """Return the result of what a process has in hand, and whether it can go on."""
    if not hand.pipe.poll():
        return lost(hand.task, f"its process did not end within {patience:g} s"), False
    try:
        result: R = hand.pipe.recv()
    except (EOFError, OSError):  # the latter if it ended before it read its task
        hand.process.join()
        return lost(hand.task, f"its process ended with {hand.process.exitcode}"), False
    return result, True


def _work(pipe: Connection[Any, Any], act: Callable[[Any], Any]) -> None:
    """Do one task after another, until nobody is there who gives any."""
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        pipe.send(act(task))
