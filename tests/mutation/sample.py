"""Keep a random sample of the mutants of a cosmic-ray session.

``python tests/mutation/sample.py SESSION COUNT SEED`` draws places in the source first, then one of the mutants at
each place: an operator with many replacements counts once.
"""

from __future__ import annotations

import random
import sys
from collections import defaultdict

from cosmic_ray.work_db import WorkDB, use_db
from cosmic_ray.work_item import WorkItem


def main(session: str, count: str, seed: str) -> None:
    """Remove all other mutants, and those that a filter has skipped, from the session."""
    rng = random.Random(int(seed))
    with use_db(session, WorkDB.Mode.open) as db:
        places: dict[tuple[str, tuple[int, int]], list[WorkItem]] = defaultdict(list)
        for item in db.pending_work_items:
            (mutation,) = item.mutations
            places[str(mutation.module_path), mutation.start_pos].append(item)
        drawn = rng.sample(sorted(places), int(count))
        mutants = [rng.choice(sorted(places[place], key=str)) for place in drawn]
        db.clear()
        db.add_work_items(mutants)


if __name__ == "__main__":
    main(*sys.argv[1:])
