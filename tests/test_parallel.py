"""Work shared by processes: order, errors, and that nothing is left running."""

from __future__ import annotations

import math
import multiprocessing
import os
import time

import pytest

from systems.parallel import WorkerError, apart, in_parallel, processors


class EnoughError(Exception):
    pass


def stop(_done: int) -> None:
    raise EnoughError


@pytest.mark.parametrize("workers", [1, 2])
def test_answers_come_in_the_order_of_the_tasks(workers):
    numbers = [4.0, 1.0, 9.0, 0.25]
    told = []
    found = in_parallel(math.sqrt, [(n,) for n in numbers], workers, told.append)
    assert found == [2.0, 1.0, 3.0, 0.5]
    assert told == sorted(told)
    assert not multiprocessing.active_children()


@pytest.mark.parametrize("workers", [1, 2])
def test_what_the_work_raises_is_raised(workers):
    with pytest.raises(ValueError, match="math domain error"):
        in_parallel(math.sqrt, [(1.0,), (-1.0,), (1.0,)], workers)
    assert not multiprocessing.active_children()


def test_who_wants_to_stop_waits_for_no_worker():
    begun = time.monotonic()
    with pytest.raises(EnoughError):
        in_parallel(time.sleep, [(60.0,), (60.0,)], 2, stop)
    assert not multiprocessing.active_children()
    assert time.monotonic() - begun < 50.0  # not a measurement: the work itself would take a minute


def test_a_killed_worker_is_told():
    with pytest.raises(WorkerError, match="killed"):
        in_parallel(os._exit, [(3,), (3,)], 2)
    assert not multiprocessing.active_children()


def test_apart_a_killed_process_takes_no_other_task_with_it():
    found = {}
    for some in apart(leave, [(0,), (9,), (0,), (0,)], 2):
        found |= some
    assert isinstance(found.pop(1), WorkerError)
    assert found == {0: 0, 2: 0, 3: 0}
    assert not multiprocessing.active_children()


def test_apart_what_cannot_come_back_is_an_error_too():
    (found,) = (some[0] for some in apart(eval, [("lambda: 0",)], 1) if some)
    assert isinstance(found, WorkerError)
    assert "no answer" in str(found)


def test_apart_closing_ends_all_processes():
    rounds = apart(time.sleep, [(60.0,), (60.0,)], 2)
    assert next(rounds) == {}
    rounds.close()
    assert not multiprocessing.active_children()


def leave(code: int) -> int:
    """Ends its process where the code says so."""
    return os._exit(code) if code else code


def test_processors_are_some():
    assert 1 <= processors() <= 8
