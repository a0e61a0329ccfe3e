"""False questions of the examination on campaigns without a slip, by slip, and its processor time.

Run as ``python -m benchmarks.examination FOLDER ...``, with folders of campaigns without a slip, such as blind
sets. Notes on a spring or an inertia that does not fit count separately: these may be effects.
"""

from __future__ import annotations

import argparse
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from identification.examination.examine import measured
from identification.examination.slips.compared_labels import inertia_off_the_springs, spring_off_the_line
from identification.examination.slips.table import RECORD_SLIPS, STATEMENT_SLIPS
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.vocabulary.campaign import Campaign

NOT_SLIPS = {spring_off_the_line.__name__, inertia_off_the_springs.__name__}
"""Slips that may also be effects."""


@dataclass
class Count:
    """Number of campaigns, questioned campaigns by name of the slip, and seconds."""

    campaigns: int = 0
    questioned: dict[str, list[str]] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)

    def add(self, campaign: Campaign, name: str) -> None:
        """Examine one campaign."""
        begun = time.process_time()
        found = questioned_by(campaign)
        self.seconds.append(time.process_time() - begun)
        self.campaigns += 1
        for slip in found:
            self.questioned.setdefault(slip, []).append(name)


def questioned_by(campaign: Campaign) -> tuple[str, ...]:
    """Names of the slips that question a campaign."""
    found = [slip.__name__ for slip in RECORD_SLIPS if slip(campaign)[1]]
    seen = measured(campaign)[2]
    if seen is not None:
        found += [slip.__name__ for slip in STATEMENT_SLIPS if slip(seen)]
    return tuple(found)


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.examination", description=__doc__)
    parser.add_argument("folders", nargs="+", type=Path)
    count = Count()
    for folder in parser.parse_args().folders:
        for path in sorted(folder.rglob("campaign.toml")):
            count.add(read_campaign(path.parent), str(path.parent))
    slips = {name: places for name, places in count.questioned.items() if name not in NOT_SLIPS}
    falsely = Counter(place for places in slips.values() for place in places)
    print(f"{count.campaigns} campaigns, {len(falsely)} questioned, {max(count.seconds):.2f} s at most")
    for name, places in count.questioned.items():
        print(f"{name}: {len(places)} ({', '.join(places[:5])})")


if __name__ == "__main__":
    main()
