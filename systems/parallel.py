"""Independent pieces of work on several processors."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections import deque
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
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
        alone: list[T] = []
        for task in tasks:
            finished(len(alone))
            alone.append(work(*task))
        return alone
    # Threads of this process (a progress bar, say) forbid to fork it.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(workers, len(tasks)), mp_context=context, initializer=_begin_worker)
    before = set(multiprocessing.active_children())
    try:
        futures = [pool.submit(work, *task) for task in tasks]
        pending = set(futures)
        while pending:
            done, pending = wait(pending, GLANCE, FIRST_COMPLETED)
            for future in done:
                future.result()
            finished(len(futures) - len(pending))
        answers = [future.result() for future in futures]
    except BaseException as error:  # whatever it is, and Ctrl-C too, ends the workers at once
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        if isinstance(error, BrokenProcessPool):
            raise WorkerError(f"a worker process was killed: {error}") from error
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
    return answers


def apart(
    work: Callable[..., T], tasks: Sequence[tuple[object, ...]], processes: int
) -> Generator[dict[int, T | WorkerError], None, None]:
    """Runs each `work(*task)` in a process of its own, so many at once; a killed one takes no other with it.

    Gives what has come in since it was last asked, by task number: answers, and the error of a process that
    ended without one. Asked again it waits at most `GLANCE`, so what it gives may be empty. `work`, tasks and
    answers must be picklable, and a script that calls this must guard its main part, as `multiprocessing`
    asks. When it is closed all processes end.
    """
    context = multiprocessing.get_context("spawn")
    before = set(multiprocessing.active_children())
    waiting = deque(enumerate(tasks))
    running: dict[Future[T], tuple[int, ProcessPoolExecutor]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < processes:
                number, task = waiting.popleft()
                pool = ProcessPoolExecutor(1, mp_context=context, initializer=_begin_worker)
                running[pool.submit(work, *task)] = (number, pool)
            ended, _ = wait(running, GLANCE, FIRST_COMPLETED)
            found: dict[int, T | WorkerError] = {}
            for future in ended:
                number, pool = running.pop(future)
                error = future.exception()
                found[number] = future.result() if error is None else _without_answer(error)
                pool.shutdown()
            yield found
    finally:
        for child in set(multiprocessing.active_children()) - before:
            child.terminate()
        for _, pool in running.values():
            pool.shutdown(wait=True, cancel_futures=True)


def _without_answer(error: BaseException) -> WorkerError:
    killed = isinstance(error, BrokenProcessPool)
    return WorkerError("its process was killed" if killed else f"its process gave no answer: {error!r}")


def _begin_worker() -> None:
    """Ctrl-C reaches all processes of a terminal; the first one ends the others, however it ends itself."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
