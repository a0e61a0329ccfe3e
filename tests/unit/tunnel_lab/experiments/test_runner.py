"""The runner of experiments: what is finished is not done again, and workers end with the first error."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from tunnel_lab.experiments.runner import processes, run_tasks


def squared(task: int) -> int:
    return task * task


def test_the_rest_is_done_and_counted_by_its_size() -> None:
    kept = {2: 4}
    seen: list[tuple[int, int]] = []
    found = run_tasks(
        squared,
        [1, 2, 3],
        processes(0),
        finished=kept.__contains__,
        keep=kept.__setitem__,
        size=lambda task: task,
        progress=lambda done, total: seen.append((done, total)),
    )
    assert (found, kept) == (1, {1: 1, 2: 4, 3: 9})
    assert seen == [(2, 6), (3, 6), (6, 6)]


def test_nothing_is_started_for_finished_tasks() -> None:
    def workers(*_: object) -> Iterator[tuple[int, int]]:
        raise AssertionError

    assert run_tasks(squared, [1, 2], workers, finished=lambda _: True, keep=print) == 2


def test_workers_are_closed_when_a_result_cannot_be_kept() -> None:
    closed: list[bool] = []

    def workers(work, tasks):
        try:
            for task in tasks:
                yield task, work(task)
        finally:
            closed.append(True)

    def full_disk(*_: object) -> None:
        raise OSError

    with pytest.raises(OSError):  # noqa: PT011
        run_tasks(squared, [1, 2], workers, finished=lambda _: False, keep=full_disk)
    assert closed == [True]
