"""The runner of experiments: what is finished is not done again, and workers end with the first error."""

from __future__ import annotations

import pytest

from tunnel_lab.experiments.experiment import Done, Experiment, run
from tunnel_lab.experiments.runner import processes


def squared(task: int) -> Done:
    return Done({"results": str(task * task).encode()})


class Kept(dict[str, Done]):
    """A store in memory."""

    def finished(self) -> set[str]:
        return set(self)

    def keep(self, name: str, done: Done) -> None:
        self[name] = done


def squares(*tasks: int) -> Experiment[int]:
    return Experiment("squares", tasks, squared, str, {}, weight=lambda task: task)


def test_the_rest_is_done_and_counted_by_its_weight() -> None:
    kept = Kept({"2": squared(2)})
    seen: list[tuple[int, int]] = []
    outcome = run(squares(1, 2, 3), kept, processes(0), lambda *now: seen.append(now))
    assert outcome.finished_before == 1
    assert {name: done.files["results"] for name, done in kept.items()} == {"1": b"1", "2": b"4", "3": b"9"}
    assert seen == [(2, 6), (3, 6), (6, 6)]


@pytest.mark.usefixtures("here")
def test_workers_are_closed_when_a_result_cannot_be_kept() -> None:
    closed: list[bool] = []

    def workers(work, tasks):
        try:
            for task in tasks:
                yield task, work(task)
        finally:
            closed.append(True)

    class Full(Kept):
        def keep(self, name: str, done: Done) -> None:
            raise OSError(name, done)

    with pytest.raises(OSError):  # noqa: PT011
        run(squares(1, 2), Full(), workers)
    assert closed == [True]
