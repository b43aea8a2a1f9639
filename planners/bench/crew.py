"""Work done by processes: one that crashes or hangs loses what it had in hand, and no more."""

from __future__ import annotations

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from multiprocessing import resource_tracker
from multiprocessing.connection import Connection, wait
from typing import Any, Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")

TICK = 1.0  # [s] between two looks at who is overdue


class _Hand(Generic[T, R]):
    """One process, and what it has in hand."""

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
        self.task: T | None = None
        self.due = 0.0

    def give(self, task: T, patience: float) -> None:
        """Hand over a task."""
        self.task, self.due = task, time.monotonic() + patience
        self.pipe.send(task)

    def dismiss(self) -> None:
        """End the process, whatever it does."""
        self.process.kill()
        self.process.join()
        self.pipe.close()


def crew(
    tasks: Iterable[T],
    act: Callable[[T], R],
    *,
    jobs: int,
    patience: float,
    lost: Callable[[T, str], R],
) -> Iterator[tuple[T, R]]:
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
    left = iter(tasks)
    hands: list[_Hand[T, R]] = []
    try:
        for task in left:
            hands.append(_Hand(act))
            hands[-1].give(task, patience)
            if len(hands) == jobs:
                break
        while hands:
            ready = wait([hand.pipe for hand in hands], timeout=TICK)
            for hand in list(hands):
                if hand.pipe not in ready and time.monotonic() < hand.due:
                    continue
                done = hand.task
                assert done is not None
                result, fit = _result(hand, done, lost, patience)
                if not fit:
                    hands.remove(hand)
                    hand.dismiss()
                following = next(left, None)
                if following is not None:
                    if not fit:
                        hand = _Hand(act)
                        hands.append(hand)
                    hand.give(following, patience)
                elif fit:
                    hands.remove(hand)
                    hand.dismiss()
                yield done, result
    finally:
        for hand in hands:
            hand.dismiss()


def _result(
    hand: _Hand[T, R], task: T, lost: Callable[[T, str], R], patience: float
) -> tuple[R, bool]:
    """Return the result of a task, and whether its process can go on."""
    if not hand.pipe.poll():
        return lost(task, f"its process did not end within {patience:g} s"), False
    try:
        result: R = hand.pipe.recv()
    except EOFError:
        hand.process.join()
        return lost(task, f"its process ended with {hand.process.exitcode}"), False
    return result, True


def _work(pipe: Connection[Any, Any], act: Callable[[Any], Any]) -> None:
    """Do one task after another, until nobody is there who gives any."""
    while True:
        try:
            task = pipe.recv()
        except EOFError:
            return
        pipe.send(act(task))
