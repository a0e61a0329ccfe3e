"""Every reader of the project on spoilt input. Truth: it answers, or refuses in one line (`answers_or_refuses`).

A million examples, on all cores: ``python -m pytest -m slow --hypothesis-profile=long --dist=load tests/fuzz``.
Where a process dies, ``-n 0 -s --hypothesis-verbosity=verbose`` shows each example before it is tried.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.fuzz import seeds
from tests.fuzz.guard import answers_or_refuses, in_fork
from tests.fuzz.places import written
from tests.fuzz.tables import csv, parquet, parquets
from tests.fuzz.texts import (
    damaged,
    nested,
    spoilt_bytes,
    spoilt_json,
    spoilt_text,
    spoilt_toml,
    spoilt_xml,
    to_json,
    to_toml,
)
from tests.fuzz.values import Draw, one_in, place_in, spoilt
from tests.support.acting import acting
from tunnel_sim.vocabulary.errors import TunnelError

Reader = Callable[[Path, Draw], None]
"""Takes an empty folder; it may raise `TunnelError` and nothing else."""


def campaign_toml(folder: Path, draw: Draw) -> None:
    """``campaign.toml`` changed, its runs whole."""
    from tunnel_sim.files.campaign_folder import read_campaign

    for name in ("r1.csv", "r2.parquet"):
        (folder / name).write_bytes(seeds.run_file(name))
    written(folder / "campaign.toml", draw(spoilt_toml(seeds.campaign_document())), draw)
    read_campaign(folder)


def _campaign_of(folder: Path, name: str, content: bytes, draw: Draw) -> None:
    from tunnel_sim.files.campaign_folder import read_campaign

    document = seeds.campaign_document()
    run = next(one for one in document["runs"] if one["file"] == name)
    sensor = {key: value for key, value in document["sensor"].items() if draw(st.booleans())}
    (folder / "campaign.toml").write_bytes(to_toml(document | {"sensor": sensor, "runs": [run]}))
    written(folder / name, content, draw)
    read_campaign(folder)


def run_csv(folder: Path, draw: Draw) -> None:
    """A run's CSV file changed."""
    _campaign_of(folder, "r1.csv", draw(csv(seeds.run_file("r1.csv"))), draw)


def run_parquet(folder: Path, draw: Draw) -> None:
    """A run's Parquet file changed."""
    _campaign_of(folder, "r2.parquet", draw(parquets(seeds.run_frame())), draw)


def import_text(folder: Path, draw: Draw) -> None:
    """A logger's text file changed, in one dialect or another."""
    content = draw(csv(seeds.run_file("r1.csv")))
    delimiter, comma = draw(st.sampled_from(b",;\t |").map(chr)).encode(), draw(st.booleans())
    content = content.replace(b",", delimiter)
    if delimiter != b"," and comma:
        content = content.replace(b".", b",")
    _read_log(written(folder / "log.txt", content, draw))


def import_head(folder: Path, draw: Draw) -> None:
    """The lines above a logger's table changed: numbers stated there, names, units and runs."""
    head = draw(spoilt_text(seeds.LOGGER_HEAD, odd=seeds.headings))
    timed, named, choices = draw(st.booleans()), draw(one_in(4)), draw(st.sampled_from(seeds.CHOICES))
    head = head if timed else head.replace("time [s];", "")
    content = head.encode("utf-8", "surrogatepass") + seeds.logger_rows(named=named, timed=timed)
    _read_log(written(folder / "log.csv", content, draw), **choices)


def import_hdf5(folder: Path, draw: Draw) -> None:
    """An HDF5 or MAT 7.3 file with attributes, groups and tables, damaged without being moved."""
    name = draw(st.sampled_from(("nested.h5", "seven.mat")))
    _read_log(written(folder / name, draw(damaged(seeds.nested_hdf5(name))), draw))


def import_file(folder: Path, draw: Draw) -> None:
    """A MAT, HDF5, Excel, TDMS, Parquet, MCAP, rosbag2 or MDF file changed."""
    endings = (".mat", ".h5", ".xlsx", ".tdms", ".parquet", ".mcap", ".db3", ".mf4")
    name = f"log{draw(st.sampled_from(endings))}"
    content = seeds.logger_file(name)
    _read_log(written(folder / name, draw(spoilt_bytes(content) | damaged(content)), draw))


def _read_log(path: Path, **choices: Any) -> None:
    """Read a file of an instrument; a reader that ends its process by an exception is a finding."""
    from tunnel_sim.files.importing.choices import ImportChoices
    from tunnel_sim.files.importing.records import read_records

    try:
        read_records([path], ImportChoices(**choices))
    except TunnelError as error:
        if "(exit status 1)" in error.what:
            raise AssertionError(error.what) from None
        raise


def plan(folder: Path, draw: Draw) -> None:
    """A campaign description changed, and its effects made."""
    from tunnel_sim.engine.virtual_campaign import plan_effects
    from tunnel_sim.files.plan_file import load_plan

    plan_effects(load_plan(written(folder / "plan.toml", draw(spoilt_toml(seeds.PLAN)), draw)))


def rig(folder: Path, draw: Draw) -> None:
    """A rig description changed."""
    from tunnel_sim.files.rig_file import load_rig

    load_rig(written(folder / "rig.toml", draw(spoilt_toml(seeds.packaged("rig.toml"))), draw))


def spring_table(folder: Path, draw: Draw) -> None:
    """A table of springs changed, and fitted and shown where it is accepted."""
    import typer

    from tunnel_lab.commands.paper import read_spring_table, show_springs

    table = read_spring_table(written(folder / "springs.csv", draw(csv(seeds.springs_csv())), draw))
    try:
        show_springs(table, "springs.csv")
    except typer.Exit:  # how the command says that there is no inertia
        return


def effect_option(_folder: Path, draw: Draw) -> None:
    """The value of ``--effect`` changed, and the effect made."""
    from tunnel_lab.terminal.arguments import parse_effect
    from tunnel_sim.effects import effect_from

    setting = parse_effect(draw(spoilt_text(seeds.EFFECT, r"[^:,=]+")))
    effect_from(setting.name, setting.parameters)


def kinds_option(_folder: Path, draw: Draw) -> None:
    """The value of ``--kinds`` of ``tunnel blind make`` changed."""
    from tunnel_reference.make import parse_shares

    parse_shares(draw(spoilt_text(seeds.KINDS, r"[^:,=]+")))


def effects_file(folder: Path, draw: Draw) -> None:
    """An effects file changed, or a formula in it; what is accepted is made, weighed and compiled."""
    from tunnel_sim.effects.capabilities import ReadingEffect
    from tunnel_sim.effects.expression_effect import read_effects
    from tunnel_sim.physics.run_settings import RunSettings
    from tunnel_sim.vocabulary.plan import AeroDerivatives

    formula = draw(st.none() | spoilt_text(draw(st.sampled_from(seeds.FORMULAS)), r"\w+|\W", seeds.tokens))
    document = seeds.effects_document(formula or seeds.FORMULAS[0])
    content = to_toml(document) if formula else draw(spoilt_toml(document))
    stated = RunSettings(16.12, AeroDerivatives(0.4, -0.1), 0.1, 0.01, wind_speed=15.0)
    for kind in read_effects(written(folder / "effects.toml", content, draw)):
        effect = kind(*kind.example)
        acting(effect, stated)
        if isinstance(effect, ReadingEffect):
            effect.on_angle(np.linspace(-0.3, 0.3, 5), np.arange(5.0), stated, None)
        if oracle := effect.moment_oracle(stated):
            oracle(0.0, 0.1, -0.1)


def model_file(folder: Path, draw: Draw) -> None:
    """A model of one's own changed, or what it includes; where its joint is accepted, it is patched."""
    from diagnosis.patch.elements import DryFriction, Inertia
    from tunnel_sim.engine import joint_model
    from tunnel_sim.engine.joint_patch import patched, patched_xml

    files = {"model.xml": seeds.URDF} if draw(one_in(5)) else dict(seeds.MODEL_FILES)
    changed = draw(st.just("model.xml") | st.sampled_from(sorted(files)))
    content = files.pop(changed)
    xml = changed.endswith("xml") and not draw(one_in(5))
    for name, other in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(other)
    written(folder / changed, draw(spoilt_xml(content) if xml else spoilt_bytes(content)), draw)
    moved, middle = 10.0 ** draw(st.floats(-6.0, 1.0)), draw(st.none() | st.floats(-3.0, 3.0))
    recorded = joint_model.Recorded(
        moved, **({} if middle is None else {"middle": middle, "controlled": True})
    )
    with patch.object(joint_model, "in_sandbox", in_fork):
        found = joint_model.read_joint_model(folder / "model.xml", "hinge", recorded)
    spec, _ = patched(found, (Inertia(found.law.inertia * draw(st.floats(0.5, 2.0))), DryFriction(0.01)))
    patched_xml(spec, found, folder)


def uncertainties(folder: Path, draw: Draw) -> None:
    """A file of uncertainties changed."""
    from identification.uncertainty.budget import load_uncertainties

    load_uncertainties(written(folder / "known.toml", draw(spoilt_toml(seeds.UNCERTAINTIES)), draw))


def estimate(_folder: Path, draw: Draw) -> None:
    """An estimate's document changed; where it is accepted, it is written again."""
    from identification.estimate import Estimate

    Estimate.from_json_dict(draw(nested(seeds.estimate_document()))).to_json_dict()


def blind_answers(folder: Path, draw: Draw) -> None:
    """Truth, answer or seal of a blind set changed; the hashes mostly agree."""
    from tunnel_lab.experiments.blind import score_page as blind
    from tunnel_lab.experiments.blind import score_set
    from tunnel_lab.experiments.blind.sets import folder_hash

    changed = draw(st.sampled_from(("truth", "answer", "truth", "answer", "seal of key", "seal of answer")))

    def put(name: str, document: Any, part: str) -> str:
        content = draw(spoilt_json(document)) if changed == part else to_json(document)
        written(folder / name, content, draw)
        return hashlib.sha256(content).hexdigest()

    (folder / "c1").mkdir()
    (folder / "c1" / "campaign.toml").write_bytes(b"")
    seen = folder_hash(folder / "c1")
    if changed == "seal of key" or draw(st.booleans()):
        key = put("key.json", {"truths": {"c1": seeds.TRUTH}, "made_with": seeds.MADE_WITH}, "truth")
        put("seal.json", {"key_sha256": key, "campaigns_sha256": {"c1": seen}}, "seal of key")
    else:
        put("c1/truth.json", seeds.TRUTH, "truth")
        seen = folder_hash(folder / "c1")
    answer = put("answers/c1.json", seeds.answer_document() | {"data_sha256": seen}, "answer")
    put("answers/seal.json", {"answers_sha256": {"c1": answer}}, "seal of answer")
    found = score_set(folder)
    found.to_json_dict()
    blind.markdown(found, "set")


def sweep_file(folder: Path, draw: Draw) -> None:
    """A sweep file changed, and its folder begun where it is accepted."""
    from tunnel_lab.experiments.experiment import begin
    from tunnel_lab.experiments.sweep import read_sweep, sweep_of

    sweep = read_sweep(written(folder / "sweep.toml", draw(spoilt_toml(seeds.SMALL.encode())), draw))
    begin(sweep_of(sweep), folder / "out")


def sweep_folder(folder: Path, draw: Draw) -> None:
    """``sweep.json`` or a part of the results changed, as a sweep that goes on or is summed up meets it."""
    from tests.support.small_sweep import open_store
    from tunnel_lab.experiments.sweep_view import overall_table, summarise

    files = dict(seeds.sweep_folder())
    names = [name for name in files if name.startswith("results")]
    changed = draw(st.just("sweep.json") | st.sampled_from(names))
    content = files.pop(changed)
    for name, other in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(other)
    sweep = changed == "sweep.json"
    spoilt_content = draw(spoilt_json(json.loads(content)) if sweep else parquets(seeds.frame_of(content)))
    written(folder / changed, spoilt_content, draw)
    store = open_store(folder)
    store.finished()
    overall_table(summarise(store.scan()))


def score_grid(folder: Path, draw: Draw) -> None:
    """A score grid changed."""
    from tunnel_lab.experiments.score_grid import load_grid

    content = draw(spoilt_toml(seeds.regression("score-grid.toml").read_bytes()))
    load_grid(written(folder / "grid.toml", content, draw))


def score_baseline(folder: Path, draw: Draw) -> None:
    """A baseline's table, or the grid in it, changed; where it is accepted, it is compared with itself."""
    import polars as pl

    from tunnel_lab.experiments.score import read_trials
    from tunnel_lab.experiments.score_view import check

    frame = seeds.baseline_frame()
    if draw(st.booleans()):
        grid = draw(spoilt_json(json.loads(frame["grid"][0]))).decode("utf-8", "replace")
        content = parquet(frame.with_columns(pl.lit(grid).alias("grid")))
    else:
        content = draw(parquets(frame))
    found = read_trials(written(folder / "baseline.parquet", content, draw))
    check(found, found)


def weights(folder: Path, draw: Draw) -> None:
    """The networks' file, or its record, changed; the hash mostly agrees."""
    from identification.neural.networks import read_networks

    content, record = seeds.weights()
    if draw(st.booleans()):
        content = draw(_spoilt_tensors(content))
    else:
        record = draw(spoilt(record))
    if isinstance(record, dict) and not draw(one_in(20)):
        record = record | {"weights_sha256": hashlib.sha256(content).hexdigest()}
    written(
        folder / "w.json", draw(spoilt_bytes(to_json(record))) if draw(one_in(10)) else to_json(record), draw
    )
    read_networks(written(folder / "w.safetensors", content, draw))


@st.composite
def _spoilt_tensors(draw: Draw, content: bytes) -> bytes:
    from safetensors.numpy import load, save

    length = int.from_bytes(content[:8], "little")
    kind = draw(place_in(4))
    if kind == 0:
        return draw(spoilt_bytes(content, 0, 8 + length))
    if kind == 1:
        header = to_json(draw(spoilt(json.loads(content[8 : 8 + length]))))
        return len(header).to_bytes(8, "little") + header + content[8 + length :]
    tensors = dict(load(content))
    for name in draw(st.lists(st.sampled_from(sorted(tensors)), min_size=1, max_size=2, unique=True)):
        tensors[name] = draw(_spoilt_array(tensors[name]))
        if draw(one_in(10)):
            del tensors[name]
    return bytes(save(tensors or {"none": np.zeros(1)}))


@st.composite
def _spoilt_array(draw: Draw, values: np.ndarray) -> np.ndarray:
    kind = draw(place_in(6))
    if kind == 0:
        return np.ascontiguousarray(values.reshape(-1)[: draw(st.integers(0, values.size))])
    if kind == 1:
        return values.reshape(1, -1)
    if kind == 2:
        return values.astype(draw(st.sampled_from((np.float32, np.int64, np.bool_, np.float16))))
    changed = np.array(values, dtype=np.float64)
    odd = draw(st.sampled_from((0.0, -1.0, 1e-300, 1e300, 1e30, float("nan"), float("inf"))))
    changed.reshape(-1)[draw(place_in(changed.size)) if kind == 3 and changed.size else slice(None)] = odd
    return changed


def checkpoint(folder: Path, draw: Draw) -> None:
    """A training's checkpoint changed; the training goes on from what is accepted."""
    from identification.neural.train import read_checkpoint, train

    spec, content = seeds.checkpoint()
    content = draw(spoilt_bytes(content) | _spoilt_tensors(content) | _spoilt_state(content))
    found = read_checkpoint(written(folder / "w.partial", content, draw), spec.to_json_dict())
    if found is not None:
        train(spec, resume=found)


@st.composite
def _spoilt_state(draw: Draw, content: bytes) -> bytes:
    """The same tensors with the text beside them changed."""
    length = int.from_bytes(content[:8], "little")
    header = json.loads(content[8 : 8 + length])
    document = json.loads(header["__metadata__"]["training"])
    kept = {} if draw(one_in(5)) else {"spec": document.pop("spec")}
    changed = draw(spoilt(document))
    text = to_json(changed | kept if isinstance(changed, dict) else changed)
    header["__metadata__"]["training"] = text.decode("utf-8", "replace")
    raw = json.dumps(header).encode()
    return len(raw).to_bytes(8, "little") + raw + content[8 + length :]


READERS: tuple[Reader, ...] = (
    campaign_toml, run_csv, run_parquet, import_text, import_file, import_head, import_hdf5, plan, rig,
    spring_table, effect_option, kinds_option, effects_file, model_file, uncertainties, estimate, blind_answers,
    sweep_file, sweep_folder, score_grid, score_baseline, weights, checkpoint,
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS, ids=lambda reader: reader.__name__)
@given(data=st.data())
def test_a_reader_answers_or_refuses_in_one_line(reader, data):
    with answers_or_refuses() as folder:
        reader(folder, data.draw)
