"""What a command cannot do is one line on standard error, status 2, and no file."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from tests.support.command import Tunnel
from tests.support.import_files import csv as record
from tests.unit.tunnel_lab.commands.test_plan import PLAN

TINY = (Path(__file__).parents[3] / "data" / "tiny-plan.toml").read_text(encoding="utf-8")
#: Plans that are not what they should be.
SPOILT = {
    "no-toml.toml": "name = [",
    "no-spring.toml": TINY.replace("springs = [5]", "springs = [11]"),
    "misspelt.toml": TINY.replace("seed = 1", "sed = 1"),
    "nan.toml": TINY.replace("cn_beta = 0.495", "cn_beta = nan"),
}
#: Each line: the words of a command, and what the refusal says.
REFUSED = """
identfy | No such command 'identfy' | identify
identify | Missing argument
springs --colour | No such option | --colour
springs one.csv two.csv | two.csv
springs missing.csv | missing.csv | no such file
identify missing | missing | no such folder
plot missing | missing | no such folder
identify missing --estimator output_eror | output_eror | did you mean 'output_error'
simulate tiny.toml | Missing option | --out
simulate tiny.toml --out x --file-format xls | xls | parquet | csv
simulate tiny.toml --out x --seed -1 | --seed
simulate tiny.toml --out x --seed one | --seed
simulate missing.toml --out x | missing.toml
simulate no-toml.toml --out x | no-toml.toml | TOML
simulate no-spring.toml --out x | no-spring.toml | there is no spring 11
simulate misspelt.toml --out x | misspelt.toml | sed
simulate nan.toml --out x | nan.toml | cn_beta
simulate tiny.toml --out x --effect coulomb_fricton:friction_moment=0.1 | did you mean 'coulomb_friction'?
simulate tiny.toml --out x --effect coulomb_friction:friction=0.1 | did you mean 'friction_moment'?
simulate tiny.toml --out x --effect coulomb_friction:friction_moment=nan | nan is out of range
simulate tiny.toml --out x --effect coulomb_friction:friction_moment=-1 | -1.0 is out of range
simulate tiny.toml --out x --effect coulomb_friction | friction_moment is missing
simulate tiny.toml --out x --effect mains_hum:amplitude=0.1 --effect mains_hum:amplitude=0.1 | given twice
simulate tiny.toml --out x --effect coulomb_friction:0.1 | is not PARAMETER=VALUE
simulate tiny.toml --out x --effect spring_miscalibration:error=0.1,spring_stiffness=1 | no run has a spring
plan free.toml --out y.toml --moment 0.5 --amplitude 0.3 | nothing to plan; add --drive
plan free.toml --out y.toml --drive --moment 0 --amplitude 0.3 | --moment: 0 is out of range; give a number
plan free.toml --out y.toml --drive --moment 1 --amplitude nan | --amplitude: nan is out of range
plan free.toml --out y.toml --drive --moment 0.5 --amplitude 0.3 --minutes 3 | starts and changes take 9.03 min
plan free.toml --out y.toml --drive --moment 0.5 --amplitude 0.3 --buffeting -1 | intensity = -1.0 is out of range
score --estimator matrix_pencl | did you mean 'matrix_pencil'
score --check none.parquet | none.parquet | no such file
score missing.toml | missing.toml | no such file
score --write-baseline no/such/folder.parquet | folder
score --breakdown --check packaged | --check | cannot be combined with --breakdown
score --trials 1 | --trials
score --jobs -1 | --jobs
train none/w.safetensors | its folder does not exist
train w.safetensors --zeta 0.3 0.1 | 0.3 0.1 is not a range
train w.safetensors --omega 0 26 | 0 26 is not a range
import log.csv | --out, --preview: give one of them
import log.csv --out rig | add --yes
import log.csv --out rig --delimiter x | 'delimiter' = 'x'
import log.csv --out rig --unit furlong | unknown unit 'furlong'
import log.csv --out rig --set speed=1 | unknown key 'speed'
import log.csv --out rig --recipe none.toml | no such file
import log.csv --out rig --rate 0 | 'rate' = 0.0
import log.csv --out rig --rest 20 | do not include the stated rest of 20 rad
import log.csv --preview import.jpg | import.jpg | .png
diagnose c --report r.pdf | r.pdf | .html
diagnose c --pdf r.html | r.html | .pdf
diagnose c --json r.html | r.html | .json
diagnose c --model m.xml --joint j --patch r.urdf | r.urdf | .xml
diagnose c --propose law.json | law.json | .toml
identify c --json e.csv | e.csv | .json
simulate plan.toml --out c --picture runs.pdf | runs.pdf | .png
export c --file-format csv --out c.mat | c.mat | .csv
plan p.toml --drive --moment 1 --amplitude 0.1 --out d.json | d.json | .toml
blind score set --figure f.pdf | f.pdf | .png
blind score set --markdown f.html | f.html | .md
effects --json e.md | e.md | .json
effects --markdown e.json | e.json | .md
score --write-baseline b.csv | b.csv | .parquet
schema plan --out s.toml | s.toml | .json
render --out film.gif | film.gif | .mp4
view --spring 99 | there is no spring 99
view --wind nan | --wind
view tiny.toml --run nonsense | has no run 'nonsense'
view --camera behind | there is no camera 'behind'
render --out a.mp4 --spring 99 | there is no spring 99
render --out a.mp4 --wind -1 | --wind
render --out a.mp4 --angle 90 | --angle
render --out a.mp4 --duration 0 | --duration
render --out a.mp4 --run x | there is no plan
render nowhere.toml --out a.mp4 | nowhere.toml
render --out a.mp4 --effect coulomb_frictoin:friction_moment=1 | did you mean 'coulomb_friction'
render --out a.mp4 --effect coulomb_friction | friction_moment is missing
render --out nowhere/a.mp4 | its folder does not exist
render --out a.png --size 100x100 | --size
render --out a.png --size big | --size
render --out a.png --size 321x240 | --size
render --out a.png --at 99 | 99 s is not in the run
render --out a.png --fps 0 | fps
paper --out p --only table-5 | no part 'table-5'
train weights.bin | weights.bin | .safetensors
"""


def test_a_refusal_is_one_line_and_leaves_nothing(
    tunnel: Tunnel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name, text in {"tiny.toml": TINY, "free.toml": PLAN, **SPOILT}.items():
        Path(name).write_text(text, encoding="utf-8")
    record(tmp_path)
    before, faults = sorted(tmp_path.rglob("*")), []
    for line in REFUSED.strip().splitlines():
        words, *parts = (part.strip() for part in line.split(" | "))
        status, out, err = tunnel(*shlex.split(words))
        one_line = err.startswith("tunnel: ") and err.endswith("\n") and err.count("\n") == 1
        quiet = out == "" or words.startswith("import")  # which first says what it read
        if (status, quiet, one_line) != (2, True, True) or any(part not in err for part in parts):
            faults.append((words, status, out, err))
        if sorted(tmp_path.rglob("*")) != before:
            faults.append((words, "something was written"))
            before = sorted(tmp_path.rglob("*"))
    assert faults == []
