"""The smallest entry: `python entry.py CAMPAIGNS ANSWERS`. It does not depend on this project.

It answers "coulomb_friction" where the decay of the first run accelerates towards its end, and no cause otherwise.
"""

import json
import sys
import time
from pathlib import Path

import polars as pl

campaigns, answers = Path(sys.argv[1]), Path(sys.argv[2])
answers.mkdir(parents=True, exist_ok=True)
for folder in sorted(path.parent for path in campaigns.glob("*/campaign.toml")):
    begun = time.process_time()
    file = sorted((folder / "runs").iterdir())[0]
    table = pl.read_parquet(file) if file.suffix == ".parquet" else pl.read_csv(file)
    angle = table[table.columns[-1]].to_numpy()
    third = len(angle) // 3
    start, middle, end = (
        part.max() - part.min() for part in (angle[:third], angle[third : 2 * third], angle[-third:])
    )
    friction = start > 0 and end / middle < middle / start
    answer = {
        "schema_version": 1,
        "campaign": folder.name,
        "causes": ["coulomb_friction"] if friction else [],
        "probability": {"coulomb_friction": 0.5 if friction else 0.1},
        "seconds": round(time.process_time() - begun, 3),
    }
    (answers / f"{folder.name}.json").write_text(json.dumps(answer, indent=1))
