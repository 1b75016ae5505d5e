"""Independent pieces of work on several processors."""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import TypeVar

T = TypeVar("T")

MOST_WORKERS = 8
GLANCE = 0.2  # [s], between two looks whether somebody wants to stop


class WorkerError(RuntimeError):
    """A worker process ended without an answer."""


def processors() -> int:
    """How many processors this process may use, at most `MOST_WORKERS`."""
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else (os.cpu_count() or 1)
    return min(count, MOST_WORKERS)


def in_parallel(
    work: Callable[..., T],
    tasks: Sequence[tuple[object, ...]],
    workers: int,
    finished: Callable[[int], None] = lambda _count: None,
) -> list[T]:
    """`work(*task)` for every task, in their order; `finished` is told how many are done, now and then.

    With one worker all happens in this process. Otherwise `work`, tasks and answers must be picklable, and a
    script that calls this must guard its main part, as `multiprocessing` asks. What `finished` raises ends
    the workers.

    Raises
    ------
    What `work` raises; WorkerError when a process is killed.
    """
    if workers <= 1 or len(tasks) <= 1:
        answers: list[T] = []
        for task in tasks:
            finished(len(answers))
            answers.append(work(*task))
        return answers
    # Threads of this process (a progress bar, say) forbid to fork it.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(workers, len(tasks)), mp_context=context, initializer=_ignore_interrupts)
    before = set(multiprocessing.active_children())
    try:
        futures = [pool.submit(work, *task) for task in tasks]
        pending = set(futures)
        while pending:
            done, pending = wait(pending, GLANCE, FIRST_COMPLETED)
            for future in done:
                future.result()
            finished(len(futures) - len(pending))
        return [future.result() for future in futures]
    except BrokenProcessPool as error:
        raise WorkerError(f"a worker process was killed: {error}") from error
    finally:
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        pool.shutdown(wait=True, cancel_futures=True)


def _ignore_interrupts() -> None:
    """Ctrl-C reaches all processes of a terminal; the first one ends the others."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
