"""Independent pieces of work on several processors."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
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

    With one worker all happens in this process, otherwise as in `as_finished`. What `finished` raises ends
    the workers.

    Raises
    ------
    What `work` raises; WorkerError when a process is killed.
    """
    if workers <= 1 or len(tasks) <= 1:
        alone: list[T] = []
        for task in tasks:
            finished(len(alone))
            alone.append(work(*task))
        return alone
    answers: dict[int, T] = {}
    with contextlib.closing(as_finished(work, tasks, workers)) as rounds:
        for found in rounds:
            answers |= found
            finished(len(answers))
    return [answers[number] for number in range(len(tasks))]


def as_finished(
    work: Callable[..., T], tasks: Sequence[tuple[object, ...]], workers: int
) -> Generator[dict[int, T], None, None]:
    """Runs `work(*task)` in processes; gives the answers that came since it was last asked, by task number.

    Asked again it waits at most `GLANCE`, so what it gives may be empty. `work`, tasks and answers must be
    picklable, and a script that calls this must guard its main part, as `multiprocessing` asks. When it is
    closed the workers end at once.

    Raises
    ------
    What `work` raises; WorkerError when a process is killed.
    """
    # Threads of this process (a progress bar, say) forbid to fork it.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(workers, len(tasks)), mp_context=context, initializer=_begin_worker)
    before = set(multiprocessing.active_children())
    try:
        number = {pool.submit(work, *task): i for i, task in enumerate(tasks)}
        pending = set(number)
        while pending:
            done, pending = wait(pending, GLANCE, FIRST_COMPLETED)
            yield {number[future]: future.result() for future in done}
    except BaseException as error:  # whatever it is, and Ctrl-C too, ends the workers at once
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        if isinstance(error, BrokenProcessPool):
            raise WorkerError(f"a worker process was killed: {error}") from error
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _begin_worker() -> None:
    """Ctrl-C reaches all processes of a terminal; the first one ends the others, however it ends itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
