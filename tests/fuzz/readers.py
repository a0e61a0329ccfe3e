"""Every reader of the project, each given a mutated input.

A target takes an empty folder and a generator. It may raise `TunnelError` and nothing else.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from tests.fuzz import seeds
from tests.fuzz.forks import in_fork
from tests.fuzz.places import estranged
from tests.fuzz.tables import changed_csv, changed_parquet
from tests.fuzz.texts import (
    as_json,
    as_toml,
    changed_bytes,
    changed_formula,
    changed_head,
    changed_line,
    changed_xml,
    damaged,
    nested,
)
from tests.fuzz.values import Rng, mutated
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError

Target = Callable[[Path, Rng], None]
READER_SECONDS = 3.0
"""After which the guard ends a library, so that the trial does not wait for too long."""
STRANGE = 0.02
"""Share of the trials in which a file becomes something other than a file."""


def _toml(seed: bytes | dict[str, Any], rng: Rng) -> bytes:
    tree = seeds.tree(seed) if isinstance(seed, bytes) else seed
    if rng.random() < 0.75:
        return as_toml(mutated(tree, rng), rng)
    return changed_bytes(seed if isinstance(seed, bytes) else as_toml(tree, rng), rng)


def _json(tree: Any, rng: Rng) -> bytes:
    if rng.random() < 0.75:
        return as_json(mutated(tree, rng), rng)
    return changed_bytes(as_json(tree, rng), rng)


def _written(path: Path, content: bytes, rng: Rng) -> Path:
    """Write a file; now and then something that is no file stands there in the end."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    if rng.random() < STRANGE:
        estranged(path, rng)
    return path


def campaign_toml(folder: Path, rng: Rng) -> None:
    """``campaign.toml`` changed, its runs whole."""
    from tunnel_sim.files.campaign_folder import read_campaign

    for name in ("r1.csv", "r2.parquet"):
        (folder / name).write_bytes(seeds.run_file(name))
    _written(folder / "campaign.toml", _toml(seeds.campaign_document(), rng), rng)
    read_campaign(folder)


def _campaign_of(folder: Path, name: str, content: bytes, rng: Rng) -> None:
    from tunnel_sim.files.campaign_folder import read_campaign

    document = seeds.campaign_document()
    run = next(one for one in document["runs"] if one["file"] == name)
    sensor = {key: value for key, value in document["sensor"].items() if rng.random() < 0.5}
    (folder / "campaign.toml").write_bytes(as_toml(document | {"sensor": sensor, "runs": [run]}, rng))
    _written(folder / name, content, rng)
    read_campaign(folder)


def run_csv(folder: Path, rng: Rng) -> None:
    """A run's CSV file changed."""
    _campaign_of(folder, "r1.csv", changed_csv(seeds.run_file("r1.csv"), rng), rng)


def run_parquet(folder: Path, rng: Rng) -> None:
    """A run's Parquet file changed."""
    _campaign_of(folder, "r2.parquet", changed_parquet(seeds.run_frame(), rng), rng)


def import_text(folder: Path, rng: Rng) -> None:
    """A logger's text file changed, in one dialect or another."""
    from tunnel_sim.files.importing.records import read_records

    content = changed_csv(seeds.run_file("r1.csv"), rng)
    if rng.random() < 0.5:
        delimiter = (b";", b"\t", b" ", b"|")[rng.integers(4)]
        content = content.replace(b",", delimiter)
        content = content.replace(b".", b",") if rng.random() < 0.5 else content
    read_records([_written(folder / "log.txt", content, rng)])


def import_head(folder: Path, rng: Rng) -> None:
    """The lines above a logger's table changed: numbers stated there, names, units and runs."""
    content = seeds.logger_head().decode()
    for _ in range(int(rng.integers(1, 4))):
        content = changed_head(content, rng)
    timed = bool(rng.random() < 0.6)
    content = content if timed else content.replace("time [s];", "")
    rows = seeds.logger_rows(named=bool(rng.random() < 0.25), timed=timed)
    choices = seeds.CHOICES[rng.integers(len(seeds.CHOICES))]
    _read_log(_written(folder / "log.csv", content.encode("utf-8", "surrogatepass") + rows, rng), **choices)


def import_hdf5(folder: Path, rng: Rng) -> None:
    """An HDF5 or MAT 7.3 file with attributes, groups and tables, damaged without being moved."""
    name = ("nested.h5", "seven.mat")[rng.integers(2)]
    _read_log(_written(folder / name, damaged(seeds.nested_hdf5(name), rng), rng))


def _read_log(path: Path, **choices: Any) -> None:
    """Read a file of an instrument; a reader that ends its process by an exception is a finding."""
    from tunnel_sim.files.importing.conditions import ImportChoices
    from tunnel_sim.files.importing.records import read_records

    try:
        with patch.object(limits, "READER_SECONDS", READER_SECONDS):
            read_records([path], ImportChoices(**choices))
    except TunnelError as error:
        if "(exit status 1)" in error.what:
            raise RuntimeError(error.what) from None
        raise


def import_file(folder: Path, rng: Rng) -> None:
    """A MAT, HDF5, Excel, TDMS or Parquet file changed."""
    names = ("log.mat", "log.h5", "log.xlsx", "log.tdms", "log.parquet")
    name = names[rng.integers(len(names))]
    change = changed_bytes if rng.random() < 0.5 else damaged
    _read_log(_written(folder / name, change(seeds.logger_file(name), rng), rng))


def plan(folder: Path, rng: Rng) -> None:
    """A campaign description changed, and its effects made."""
    from tunnel_sim.engine.virtual_campaign import plan_effects
    from tunnel_sim.files.plan_file import load_plan

    plan_effects(load_plan(_written(folder / "plan.toml", _toml(seeds.PLAN, rng), rng)))


def rig(folder: Path, rng: Rng) -> None:
    """A rig description changed."""
    from tunnel_sim.files.rig_file import load_rig

    load_rig(_written(folder / "rig.toml", _toml(seeds.packaged("rig.toml"), rng), rng))


def spring_table(folder: Path, rng: Rng) -> None:
    """A table of springs changed, and fitted and shown where it is accepted."""
    import typer

    from tunnel_lab.commands.paper import read_spring_table, show_springs

    table = read_spring_table(_written(folder / "springs.csv", changed_csv(seeds.springs_csv(), rng), rng))
    try:
        show_springs(table, "springs.csv")
    except typer.Exit:  # how the command says that there is no inertia
        return


def effect_option(_folder: Path, rng: Rng) -> None:
    """The value of ``--effect`` changed, and the effect made."""
    from tunnel_lab.terminal.inputs import parse_effect
    from tunnel_sim.effects import effect_from

    setting = parse_effect(changed_line(seeds.EFFECT, rng))
    effect_from(setting.name, setting.parameters)


def kinds_option(_folder: Path, rng: Rng) -> None:
    """The value of ``--kinds`` of ``tunnel blind make`` changed."""
    from tunnel_reference.make import parse_shares

    parse_shares(changed_line(seeds.KINDS, rng))


def effects_file(folder: Path, rng: Rng) -> None:
    """An effects file changed, or a formula in it; what is accepted is made, weighed and compiled."""
    from tunnel_sim.effects.expression_effect import read_effects
    from tunnel_sim.physics.run_settings import RunSettings
    from tunnel_sim.vocabulary.plan import AeroDerivatives

    document = seeds.effects_document()
    if rng.random() < 0.6:
        formula = seeds.FORMULAS[rng.integers(len(seeds.FORMULAS))]
        document["effects"][0]["moment"] = changed_formula(formula, rng)
        content = as_toml(document, rng)
    else:
        content = _toml(document, rng)
    stated = RunSettings(16.12, AeroDerivatives(0.4, -0.1), 0.1, 0.01, wind_speed=15.0)
    for kind in read_effects(_written(folder / "effects.toml", content, rng)):
        effect = kind(*kind.example)
        effect.on_run(stated, stated, None)
        effect.on_angle(np.linspace(-0.3, 0.3, 5), np.arange(5.0), stated, None)
        if oracle := effect.moment_oracle(stated):
            oracle(0.0, 0.1, -0.1)


def model_file(folder: Path, rng: Rng) -> None:
    """A model of one's own changed, or what it includes; where its joint is accepted, it is patched."""
    from tunnel_sim.engine import joint_model
    from tunnel_sim.engine.joint_patch import JointPatch, patched, patched_xml

    files = dict(seeds.MODEL_FILES) if rng.random() < 0.8 else {"model.xml": seeds.URDF}
    changed = "model.xml" if rng.random() < 0.8 else list(files)[rng.integers(len(files))]
    xml = changed.endswith("xml") and rng.random() < 0.8
    files[changed] = changed_xml(files[changed], rng) if xml else changed_bytes(files[changed], rng)
    for name, content in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(content)
    if rng.random() < STRANGE:
        estranged(folder / changed, rng)
    with patch.object(joint_model, "in_limited_process", in_fork):
        moved = float(10.0 ** rng.uniform(-6.0, 1.0))
        driven = {"middle": float(rng.uniform(-3.0, 3.0)), "controlled": True} if rng.random() < 0.3 else {}
        recorded = joint_model.Recorded(moved, **driven)
        found = joint_model.read_joint_model(folder / "model.xml", "hinge", recorded)
    law = JointPatch(found.law.inertia * float(rng.uniform(0.5, 2.0)), friction=0.01)
    spec, _ = patched(found, law)
    patched_xml(spec, found, folder)


def uncertainties(folder: Path, rng: Rng) -> None:
    """A file of uncertainties changed."""
    from identification.uncertainty.budget import load_uncertainties

    load_uncertainties(_written(folder / "known.toml", _toml(seeds.UNCERTAINTIES, rng), rng))


def estimate(_folder: Path, rng: Rng) -> None:
    """An estimate's document changed; where it is accepted, it is written again."""
    from identification.estimate import Estimate

    Estimate.from_json_dict(nested(mutated(seeds.estimate_document(), rng), rng)).to_json_dict()


def blind_answers(folder: Path, rng: Rng) -> None:
    """Truth, answer, key or seal of a blind set changed; the hashes mostly agree."""
    from diagnosis.blind import score_set
    from tunnel_lab.report import blind

    changed = ("truth", "answer", "seal")[rng.choice(3, p=(0.4, 0.4, 0.2))]
    (folder / "c1").mkdir()
    (folder / "c1" / "campaign.toml").write_bytes(b"")
    sealed = rng.random() < 0.5
    truth = {"truths": {"c1": seeds.TRUTH}, "made_with": seeds.MADE_WITH} if sealed else seeds.TRUTH
    key = _json(truth, rng) if changed == "truth" else as_json(truth, rng)
    _written(folder / ("key.json" if sealed else "c1/truth.json"), key, rng)
    if sealed:
        _seal_of_key(folder, key, changed, rng)
    _answer(folder, changed, rng)
    found = score_set(folder)
    found.to_json_dict()
    blind.markdown(found, "set")


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _seal_of_key(folder: Path, key: bytes, changed: str, rng: Rng) -> None:
    from diagnosis.blind.sets import folder_hash

    seal = {"key_sha256": _digest(key), "campaigns_sha256": {"c1": folder_hash(folder / "c1")}}
    content = _json(seal, rng) if changed == "seal" and rng.random() < 0.5 else as_json(seal, rng)
    _written(folder / "seal.json", content, rng)


def _answer(folder: Path, changed: str, rng: Rng) -> None:
    from diagnosis.blind.sets import folder_hash

    document = seeds.answer_document() | {"data_sha256": folder_hash(folder / "c1")}
    content = _json(document, rng) if changed == "answer" else as_json(document, rng)
    _written(folder / "answers" / "c1.json", content, rng)
    seal = {"answers_sha256": {"c1": _digest(content)}}
    content = _json(seal, rng) if changed == "seal" else as_json(seal, rng)
    _written(folder / "answers" / "seal.json", content, rng)


def sweep_file(folder: Path, rng: Rng) -> None:
    """A sweep file changed, and its folder begun where it is accepted."""
    from tunnel_lab.experiments.sweep import begin
    from tunnel_lab.experiments.sweep_cases import read_sweep

    sweep = read_sweep(_written(folder / "sweep.toml", _toml(seeds.SMALL.encode(), rng), rng))
    begin(sweep, folder / "out")


def sweep_folder(folder: Path, rng: Rng) -> None:
    """``sweep.json`` or a part of the results changed, as a sweep that goes on or is summed up meets it."""
    from tunnel_lab.experiments.sweep import open_store
    from tunnel_lab.experiments.sweep_summary import overall_table, summarise

    files = dict(seeds.sweep_folder())
    names = [name for name in files if name.startswith("results")]
    changed = "sweep.json" if rng.random() < 0.4 else names[rng.integers(len(names))]
    if changed == "sweep.json":
        files[changed] = _json(json.loads(files[changed]), rng)
    else:
        files[changed] = changed_parquet(seeds.frame_of(files[changed]), rng)
    for name, content in files.items():
        if name == changed:
            _written(folder / name, content, rng)
        else:
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(content)
    store = open_store(folder)
    store.finished()
    overall_table(summarise(store))


def score_grid(folder: Path, rng: Rng) -> None:
    """A score grid changed."""
    from tunnel_lab.experiments.score_grid import load_grid

    load_grid(
        _written(folder / "grid.toml", _toml(seeds.regression("score-grid.toml").read_bytes(), rng), rng)
    )


def score_baseline(folder: Path, rng: Rng) -> None:
    """A baseline's table, or the grid in it, changed; where it is accepted, it is compared with itself."""
    import polars as pl

    from tunnel_lab.experiments.score_trials import read_trials
    from tunnel_lab.experiments.score_view import check

    frame = seeds.baseline_frame()
    if rng.random() < 0.5:
        grid = _json(json.loads(frame["grid"][0]), rng).decode("utf-8", "replace")
        content = seeds.parquet(frame.with_columns(pl.lit(grid).alias("grid")))
    else:
        content = changed_parquet(frame, rng)
    found = read_trials(_written(folder / "baseline.parquet", content, rng))
    check(found, found)


def weights(folder: Path, rng: Rng) -> None:
    """The networks' file, or its record, changed; the hash mostly agrees."""
    from identification.neural.networks import read_networks

    content, record = seeds.weights()
    if rng.random() < 0.6:
        content = _changed_tensors(content, rng)
    else:
        record = mutated(record, rng)
    if isinstance(record, dict) and rng.random() < 0.95:
        record = record | {"weights_sha256": _digest(content)}
    text = changed_bytes(as_json(record, rng), rng) if rng.random() < 0.1 else as_json(record, rng)
    _written(folder / "w.json", text, rng)
    read_networks(_written(folder / "w.safetensors", content, rng))


def _changed_tensors(content: bytes, rng: Rng) -> bytes:
    from safetensors.numpy import load, save

    length = int.from_bytes(content[:8], "little")
    kind = rng.integers(4)
    if kind == 0:
        return changed_bytes(content, rng, 0, 8 + length)
    if kind == 1:
        header = as_json(mutated(json.loads(content[8 : 8 + length]), rng), rng)
        return len(header).to_bytes(8, "little") + header + content[8 + length :]
    tensors = dict(load(content))
    for _ in range(int(rng.integers(1, 3))):
        name = list(tensors)[rng.integers(len(tensors))]
        tensors[name] = _changed_array(tensors[name], rng)
        if rng.random() < 0.1:
            del tensors[name]
    return bytes(save(tensors or {"none": np.zeros(1)}))


def _changed_array(values: np.ndarray, rng: Rng) -> np.ndarray:
    kind = rng.integers(6)
    if kind == 0:
        return np.ascontiguousarray(values.reshape(-1)[: rng.integers(values.size + 1)])
    if kind == 1:
        return values.reshape(1, -1)
    if kind == 2:
        kind = (np.float32, np.int64, np.bool_, np.float16)[rng.integers(4)]
        with np.errstate(all="ignore"):  # a value may already be odd; what is judged is its reader
            return values.astype(kind)
    changed = np.array(values, dtype=np.float64)
    odd = float(rng.choice((0.0, -1.0, 1e-300, 1e300, 1e30, float("nan"), float("inf"))))
    changed.reshape(-1)[rng.integers(changed.size) if kind == 3 and changed.size else slice(None)] = odd
    return changed


def checkpoint(folder: Path, rng: Rng) -> None:
    """A training's checkpoint changed; the training goes on from what is accepted."""
    from identification.neural.train import read_checkpoint, train

    spec, content = seeds.checkpoint()
    kind = rng.integers(3)
    if kind == 0:
        content = changed_bytes(content, rng)
    else:
        content = _changed_tensors(content, rng) if kind == 1 else _changed_state(content, rng)
    found = read_checkpoint(_written(folder / "w.partial", content, rng), spec.to_json_dict())
    if found is not None:
        train(spec, resume=found)


def _changed_state(content: bytes, rng: Rng) -> bytes:
    """The same tensors with the text beside them changed."""
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    document = json.loads(header["__metadata__"]["training"])
    keep = {"spec": document["spec"]} if rng.random() < 0.8 else {}
    changed = mutated({k: v for k, v in document.items() if k not in keep}, rng)
    text = as_json(changed | keep if isinstance(changed, dict) else changed, rng).decode("utf-8", "replace")
    header["__metadata__"]["training"] = text
    raw = json.dumps(header).encode()
    return len(raw).to_bytes(8, "little") + raw + content[8 + length :]


READERS: dict[str, tuple[Target, float]] = {
    "campaign_toml": (campaign_toml, 3.0),
    "run_csv": (run_csv, 2.0),
    "run_parquet": (run_parquet, 2.0),
    "import_text": (import_text, 2.0),
    "import_file": (import_file, 1.0),
    "import_head": (import_head, 1.0),
    "import_hdf5": (import_hdf5, 1.0),
    "plan": (plan, 2.0),
    "rig": (rig, 1.0),
    "spring_table": (spring_table, 1.0),
    "effect_option": (effect_option, 1.0),
    "kinds_option": (kinds_option, 0.2),
    "effects_file": (effects_file, 1.0),
    "model_file": (model_file, 1.0),
    "uncertainties": (uncertainties, 1.0),
    "estimate": (estimate, 2.0),
    "blind_answers": (blind_answers, 2.0),
    "sweep_file": (sweep_file, 1.0),
    "sweep_folder": (sweep_folder, 1.0),
    "score_grid": (score_grid, 1.0),
    "score_baseline": (score_baseline, 1.0),
    "weights": (weights, 1.0),
    "checkpoint": (checkpoint, 0.5),
}
"""Every reader with its weight among the readers."""
