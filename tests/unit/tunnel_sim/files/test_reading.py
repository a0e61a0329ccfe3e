"""What reads files: regular ones only, of limited size, and nothing but one `TunnelError` for what is malformed."""

import json
import os
import struct
from collections.abc import Callable
from importlib import resources
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from identification.estimate import Estimate, RunEstimate
from identification.neural.networks import read_networks, shipped_record
from identification.neural.train import Checkpoint, read_checkpoint
from identification.show.quantity import Quantity
from identification.uncertainty.budget import load_uncertainties
from tests.support.small_sweep import open_store
from tunnel_lab.commands.paper import read_spring_table
from tunnel_lab.experiments.blind.sets import file_hash, read_hashes
from tunnel_lab.experiments.score import read_trials
from tunnel_lab.experiments.score_grid import load_grid
from tunnel_lab.experiments.sweep import read_sweep
from tunnel_sim.files.campaign_folder import read_campaign
from tunnel_sim.files.plan_file import load_plan
from tunnel_sim.files.reading import check_count, parse_json, read_json, read_regular
from tunnel_sim.files.rig_file import load_rig
from tunnel_sim.files.run_files import read_table
from tunnel_sim.vocabulary import limits
from tunnel_sim.vocabulary.errors import TunnelError

DEEP = 100_000
READERS: dict[str, tuple[str, Callable[[Path], object]]] = {
    "campaign": ("campaign.toml", lambda path: read_campaign(path.parent)),
    "csv run": ("run.csv", lambda path: read_table(path, str(path))),
    "parquet run": ("run.parquet", lambda path: read_table(path, str(path))),
    "plan": ("plan.toml", load_plan),
    "rig": ("rig.toml", load_rig),
    "sweep file": ("sweep.toml", read_sweep),
    "grid": ("grid.toml", load_grid),
    "uncertainties": ("known.toml", load_uncertainties),
    "springs": ("springs.csv", read_spring_table),
    "sweep folder": ("sweep.json", lambda path: open_store(path.parent)),
    "baseline": ("trials.parquet", read_trials),
    "weights": ("w.safetensors", read_networks),
    "seal": ("seal.json", lambda path: read_hashes(path, "answers_sha256", "restore it")),
    "answer": ("c.json", lambda path: read_json(path, remedy="restore it")),
    "hash": ("run.csv", file_hash),
}


def refused(read: Callable[[Path], object], path: Path) -> TunnelError:
    with pytest.raises(TunnelError) as caught:
        read(path)
    assert str(caught.value).isprintable()
    return caught.value


@pytest.mark.parametrize("reader", READERS)
def test_a_fifo_is_refused_without_waiting(reader: str, tmp_path: Path) -> None:
    name, read = READERS[reader]
    os.mkfifo(tmp_path / name)
    assert "not a regular file" in str(refused(read, tmp_path / name))


@pytest.mark.parametrize("reader", READERS)
def test_a_device_is_refused(reader: str, tmp_path: Path) -> None:
    """It would be read for ever."""
    name, read = READERS[reader]
    (tmp_path / name).symlink_to("/dev/zero")
    assert "not a regular file" in str(refused(read, tmp_path / name))


@pytest.mark.parametrize("reader", READERS)
def test_a_file_too_large_is_refused_before_it_is_read(reader: str, tmp_path: Path) -> None:
    name, read = READERS[reader]
    with (tmp_path / name).open("wb") as stream:
        stream.truncate(2**40)
    assert "1,099,511,627,776 bytes, more than" in str(refused(read, tmp_path / name))


MALFORMED = {
    "empty": b"",
    "zeros": bytes(300),
    "not UTF-8": b'{"a": "\xff\xfe"}',
    "nested": b"[" * DEEP,
    "nested objects": b'{"a":' * DEEP,
    "nested tables": b"a" + b".a" * 2000 + b" = 1",
    "huge integer": b'{"a": 1' + b"0" * 5000 + b"}",
    "long integer": b'{"a": 1' + b"0" * 400 + b"}",
    "huge TOML integer": b"a = 1" + b"0" * 5000,
    "not a number": b'{"a": NaN}',
    "beyond floats": b'{"a": 1e999}',
    "a list": b"[1, 2]",
    "no keys": b"{}",
    "marks of Parquet": b"PAR1" + bytes(40) + b"PAR1",
    "a wide line": b"x" * 200_000 + b",y\n1,2\n",
    "a quote": b'"' + b"a,b\n" * 50_000,
    "safetensors nested": struct.pack("<Q", DEEP) + b"[" * DEEP,
}


@pytest.mark.parametrize("content", MALFORMED)
@pytest.mark.parametrize("reader", [name for name in READERS if name != "hash"])
def test_whatever_is_malformed_is_one_line(reader: str, content: str, tmp_path: Path) -> None:
    name, read = READERS[reader]
    (tmp_path / name).write_bytes(MALFORMED[content])
    (tmp_path / name).with_suffix(".json").write_bytes(MALFORMED[content])
    if (reader, content) in {("answer", "no keys")}:
        return
    refused(read, tmp_path / name)
    assert Checkpoint.from_bytes(MALFORMED[content], {}) is None


def test_a_missing_file_names_its_remedy(tmp_path: Path) -> None:
    with pytest.raises(TunnelError, match="no such file; restore it"):
        read_json(tmp_path / "none.json", remedy="restore it")
    with pytest.raises(TunnelError, match="it is a folder"):
        read_regular(tmp_path, 10)
    with pytest.raises(TunnelError, match="cannot be read"):
        read_regular(tmp_path / "a\0b", 10)


def test_a_file_that_grows_while_it_is_read_is_cut_off(tmp_path: Path) -> None:
    """The files of /proc state no size."""
    with pytest.raises(TunnelError, match="bytes, more than 3"):
        read_regular(Path("/proc/self/status"), 3)
    (tmp_path / "a").write_bytes(b"abc")
    assert read_regular(tmp_path / "a", 3) == b"abc"


def test_an_object_of_the_deepest_nesting_is_read() -> None:
    text = '{"a": ' * limits.NESTING + "1" + "}" * limits.NESTING
    assert parse_json(text, "here", "")
    with pytest.raises(TunnelError, match="nested deeper than 32 levels"):
        parse_json('{"a": ' + text + "}", "here", "")
    assert parse_json(json.dumps({"seed": 2**128 - 1}), "here", "")["seed"] == 2**128 - 1


def test_counts_are_stated_with_the_limit() -> None:
    check_count(3, 3, "runs", "here", "")
    with pytest.raises(TunnelError, match="here: 8,100,000,000 cases, more than 3; fewer"):
        check_count(300**4, 3, "cases", "here", "fewer")
    with pytest.raises(TunnelError, match="inf samples, more than 3"):
        check_count(float("inf"), 3, "samples", "here", "")
    with pytest.raises(TunnelError, match="nan samples"):
        check_count(float("nan"), 3, "samples", "here", "")


def test_a_message_is_one_line_whatever_it_holds() -> None:
    error = TunnelError("a\nb\x1b[31m", where="c\rd", remedy="e\u2028f")
    assert str(error) == "c d: a b [31m; e f"
    assert (error.what, error.where, error.remedy) == ("a b [31m", "c d", "e f")


def test_a_small_parquet_of_many_rows_is_refused_from_its_metadata(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "r.parquet"
    count = limits.RUN_SAMPLES + 1
    pl.select(pl.repeat(0.5, count, dtype=pl.Float32).alias("yaw_rad")).write_parquet(path)
    assert path.stat().st_size < 1_000_000

    def read(*_: object, **__: object) -> None:
        raise AssertionError("the data was read")

    monkeypatch.setattr(pl, "read_parquet", read)
    with pytest.raises(TunnelError, match="20,000,001 samples, more than 20,000,000"):
        read_table(path, "here")


def test_rows_and_columns_are_limited(tmp_path: Path) -> None:
    wide = {f"c{i}": [1.0] for i in range(limits.COLUMNS)} | {"yaw_rad": [1.0]}
    pl.DataFrame(wide).write_parquet(tmp_path / "wide.parquet")
    pl.DataFrame(wide).write_csv(tmp_path / "wide.csv")
    pl.DataFrame({"yaw_rad": np.zeros(11)}).write_csv(tmp_path / "long.csv")
    for name in ("wide.parquet", "wide.csv"):
        with pytest.raises(TunnelError, match="1,001 columns, more than 1,000"):
            read_table(tmp_path / name, "here")
    with pytest.raises(TunnelError, match="11 samples, more than 10;"):
        read_table(tmp_path / "long.csv", "here", most=10)
    assert read_table(tmp_path / "long.csv", "here", most=11).reading.size == 11


def test_only_the_columns_of_the_format_are_decoded(tmp_path: Path) -> None:
    lists = pl.Series([[1.0]] * 3)
    pl.DataFrame({"yaw_rad": [0.1, 0.2, 0.3], "lists": lists}).write_parquet(tmp_path / "r.parquet")
    held = read_table(tmp_path / "r.parquet", "here")
    assert (held.time_s, held.reading.tolist(), held.column) == (None, [0.1, 0.2, 0.3], "yaw_rad")


def test_a_reading_beyond_all_computing_is_refused(tmp_path: Path) -> None:
    (tmp_path / "r.csv").write_text("yaw_rad\n1.0\n1e200\n")
    with pytest.raises(TunnelError, match="yaw_rad is 1e200, not a finite number, in line 3"):
        read_table(tmp_path / "r.csv", "here")


def estimate() -> dict[str, object]:
    window = {"start_s": 0.0, "duration_s": 1.0, "cycles": 3}
    one = Quantity(1.0, 0.1, "rad/s", (0.8, 1.2)).to_json_dict()
    window |= {name: one for name in ("amplitude", "omega_n", "zeta")}
    noise = {"std": 1.0, "source": "stated", "residual_std": 1.0, "slow_ratio": 1.0, "departs": False}
    run = RunEstimate("r").to_json_dict() | {"omega_n": one, "windows": [window]}
    run["noise"] = noise | {"disagrees": False}
    found = Estimate("c", "e", ()).to_json_dict() | {"cn_beta": one, "noise": run["noise"], "runs": [run]}
    return found | {"parameters": ["cn_beta"], "covariance": [[1.0]]}


def places(value: object, path: tuple[object, ...] = ()) -> list[tuple[object, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path, *(place for key, one in items for place in places(one, (*path, key)))]


def test_an_estimate_spoilt_anywhere_is_an_estimate_or_one_line() -> None:
    """Every place of the document in turn is taken out, or holds something else."""
    assert Estimate.from_json_dict(estimate()).runs[0].windows[0].cycles == 3
    nested: object = 1
    for _ in range(DEEP):
        nested = [nested]
    spoilt = 0
    for place in places(estimate())[1:]:
        for other in (None, 1, "x", [], {}, [1, 2, 3], True, float("nan"), 10**400, nested, KeyError):
            document = json.loads(json.dumps(estimate()))
            holder = document
            for key in place[:-1]:
                holder = holder[key]
            if other is KeyError:
                del holder[place[-1]]
            else:
                holder[place[-1]] = other
            try:
                json.dumps(Estimate.from_json_dict(document).to_json_dict(), allow_nan=False)
            except TunnelError as error:
                spoilt += "the estimate as JSON" in str(error)
    assert spoilt > 200


def test_a_checkpoint_that_is_another_ones_is_none(tmp_path: Path) -> None:
    from safetensors.numpy import save

    assert read_checkpoint(tmp_path / "none", {}) is None
    good, spec = [[0.1, 1.0, 0.005, 3, False]], {"starts": 1}
    for state, ended, size in (
        (good, -1, 541), (good, 9, 541), (good, "1", 541), (good, None, 541), (good, 1, 7), ("x", 1, 541),
        ([[0.1, 1.0, "x", 3, False]], 1, 541), ([[0.1, 1.0, 0.005, -3, False]], 1, 541), ([[1.0]], 1, 541),
        ([None], 1, 541), ([[0.1, 0.0, 0.005, 3, False]], 1, 541), ([[0.0, 1.0, 0.005, 3, False]], 1, 541),
        ([[0.1, 1e300, 0.005, 3, False]], 1, 541), ([[0.1, 1.0, -1.0, 3, False]], 1, 541), (good, 1, 27),
    ):  # fmt: skip
        text = json.dumps({"spec": spec, "state": state, "ended": ended})
        content = save({"weights.0": np.zeros(size)}, {"training": text})
        assert Checkpoint.from_bytes(content, spec) is None, (state, ended, size)
    text = json.dumps({"spec": spec, "state": good, "ended": 1})
    for weight in (1e300, float("nan"), float("inf")):
        content = save({"weights.0": np.full(541, weight)}, {"training": text})
        assert Checkpoint.from_bytes(content, spec) is None, weight
    found = Checkpoint.from_bytes(save({"weights.0": np.zeros(541)}, {"training": text}), spec)
    assert found is not None
    assert len(found.ended) == 1


def test_a_training_record_that_is_not_numbers_is_refused(tmp_path: Path) -> None:
    from importlib import resources

    content = (resources.files("identification") / "neural" / "weights" / "paper.safetensors").read_bytes()
    (tmp_path / "w.safetensors").write_bytes(content)
    record = shipped_record()
    for key, spoilt in (
        ("errors", {"zeta": "x"}), ("errors", None), ("errors", dict.fromkeys(record["errors"], "1")),
        ("data", record["data"] | {"zeta_range": ["a", "b"]}), ("data", record["data"] | {"zeta_range": [1]}),
        ("data", record["data"] | {"frequency_scale": []}), ("data", []), ("weights_sha256", 3),
    ):  # fmt: skip
        (tmp_path / "w.json").write_text(json.dumps(record | {key: spoilt}))
        refused(read_networks, tmp_path / "w.safetensors")
    (tmp_path / "w.json").write_text(json.dumps(record))
    assert read_networks(tmp_path / "w.safetensors").spec.grid


RIG = (resources.files("tunnel_sim") / "data" / "rig.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "line",
    ["1" + "0" * 400 + " = 1.0", "99999999999 = 1.0", "x = 1.0", "11 = 1" + "0" * 400, "11 = 1e300", "11 = 5e-324",
     "11 = [[1]]", "11.a.b = 1", "11 = 1979-05-27", "11 = true", "11 = nan", '"\\n" = 1.0'],
)  # fmt: skip
def test_a_spring_that_is_no_number_is_refused(line: str, tmp_path: Path) -> None:
    at = RIG.index("[springs]") + len("[springs]")
    (tmp_path / "rig.toml").write_text(f"{RIG[:at]}\n{line}\n{RIG[at:]}", encoding="utf-8")
    refused(load_rig, tmp_path / "rig.toml")


@pytest.mark.parametrize("value", ["1e999", "5e-324", "nan", "1" + "0" * 400, "x" * 200_000])
def test_a_spring_table_with_numbers_beyond_computing_is_refused(value: str, tmp_path: Path) -> None:
    head = "stiffness_N_m_per_rad,frequency_Hz\n1,1\n2,1.4\n"
    (tmp_path / "s.csv").write_text(f"{head}{value},2\n")
    refused(read_spring_table, tmp_path / "s.csv")
    (tmp_path / "s.csv").write_text(head + "3,2\n" * limits.SPRINGS)
    assert "1,002 springs, more than 1,000" in str(refused(read_spring_table, tmp_path / "s.csv"))


def trials(**changes: object) -> pl.DataFrame:
    cell = {"kind": "decay", "noise": 0.01, "duration": 4.0, "amplitude": 0.35, "sample_rate": 500.0}
    cell |= {"resolution": 0.0, "zeta": 0.02, "frequency": 2.0, "springs": []}
    grid = {"name": "g", "seed": 1, "trials": 2, "trials_of": {}, "cells": [cell]}
    row = {"cell": 0, "trial": 0, "estimator": "hilbert", "truth": 1.0, "value": 1.0, "std": 0.1}
    row |= {"bound": 0.1, "status": "ok", "milliseconds": 1.0, "grid": json.dumps(grid)}
    units = {"zeta": "1", "omega_n": "rad/s"}
    return pl.DataFrame([row | {"quantity": name, "unit": unit} | changes for name, unit in units.items()])


def test_a_baseline_that_cannot_be_counted_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "b.parquet"
    trials().write_parquet(path)
    assert read_trials(path).table.height == 2
    for changes in (
        {"grid": "[" * DEEP}, {"grid": "{}"}, {"grid": None}, {"grid": 3}, {"cell": 7}, {"cell": -1},
        {"cell": "x"}, {"value": None}, {"truth": None}, {"status": None}, {"estimator": None}, {"truth": "1"},
        {"unit": "1"}, {"unit": "[bold]"}, {"bound": 0.0}, {"bound": -0.1}, {"value": 2.0, "bound": 5e-324},
        {"value": 2.0, "bound": 1e-300}, {"value": 2.0, "std": 1e-300}, {"truth": 1e-300, "bound": None},
        {"truth": 0.0, "bound": None}, {"std": -0.1}, {"value": 1e101}, {"truth": float("nan")},
        {"bound": float("inf")},
    ):  # fmt: skip
        trials(**changes).write_parquet(path)
        refused(read_trials, path)
    trials().clear().write_parquet(path)
    refused(read_trials, path)
    trials().drop("grid").write_parquet(path)
    refused(read_trials, path)
