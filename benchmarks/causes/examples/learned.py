"""An entry that learns: `python learned.py TRAINING CAMPAIGNS ANSWERS`. It does not depend on this project.

TRAINING is a set of campaigns from another seed, with its key. A campaign gets the causes of its nearest neighbours
there, by frequency and amplitude along the runs. Put another learner in place of `neighbours`.
"""

import json
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import polars as pl

NEIGHBOURS, WINDOWS, NAMED = 7, 6, 0.5


def angle(folder, run, campaign):
    """Times [s] and readings [rad] of a run."""
    file = folder / run["file"]
    table = pl.read_parquet(file) if file.suffix == ".parquet" else pl.read_csv(file)
    degrees = "yaw_deg" in table.columns
    reading = np.radians(table["yaw_deg"].to_numpy()) if degrees else table["yaw_rad"].to_numpy()
    rate = campaign["sensor"].get("sample_rate")
    times = table["time_s"].to_numpy() if "time_s" in table.columns else np.arange(len(reading)) / rate
    return times, reading - reading.mean()


def features(folder):
    """Logarithms of frequency and amplitude by window over the first; means over runs with and without wind."""
    campaign = tomllib.loads((folder / "campaign.toml").read_text())
    rows = {True: [], False: []}
    for run in campaign["runs"]:
        times, reading = angle(folder, run, campaign)
        windows = []
        for t, y in zip(np.array_split(times, WINDOWS), np.array_split(reading, WINDOWS), strict=True):
            crossings = np.flatnonzero(np.diff(np.signbit(y)))
            cycles = max(len(crossings) - 1, 1) / 2
            windows.append((np.log(cycles / (t[-1] - t[0])), np.log(np.std(y) + 1e-9)))
        rows[run["wind_speed"] > 0].append(np.ravel(np.array(windows)[1:] - windows[0]))
    return np.concatenate([np.mean(r, axis=0) if r else np.zeros(2 * WINDOWS - 2) for r in rows.values()])


def neighbours(known, labels, asked):
    """Share of the nearest training campaigns with each label, shape (labels,)."""
    scale = known.std(axis=0) + 1e-9
    near = np.argsort(np.linalg.norm((known - asked) / scale, axis=1))[:NEIGHBOURS]
    return labels[near].mean(axis=0)


training, campaigns, answers = map(Path, sys.argv[1:4])
truths = json.loads((training / "key" / "key.json").read_text())["truths"]
names = sorted({cause for truth in truths.values() for cause in truth["effects"]})
known = np.array([features(training / "campaigns" / name) for name in truths])
labels = np.array([[cause in truth["effects"] for cause in names] for truth in truths.values()], float)
answers.mkdir(parents=True, exist_ok=True)
for folder in sorted(path.parent for path in campaigns.glob("*/campaign.toml")):
    begun = time.process_time()
    shares = neighbours(known, labels, features(folder))
    probability = {name: float(share) for name, share in zip(names, shares, strict=True)}
    causes = [name for name in names if probability[name] > NAMED]
    answer = {
        "schema_version": 1,
        "campaign": folder.name,
        "causes": ["unknown"] if "unknown" in causes else causes,
        "probability": probability,
        "seconds": round(time.process_time() - begun, 3),
    }
    (answers / f"{folder.name}.json").write_text(json.dumps(answer, indent=1))
