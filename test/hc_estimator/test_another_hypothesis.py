"""A contributor adds a hypothesis with one line in one file, and the bank tries it.

A copy of the package gets one more row: a stiffness that wanders without a rate of its own. Nothing
else is touched. The copy is compiled in a process of its own, which takes a minute or two.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import hc_estimator
import hc_msgs_py

ROW = "    HypothesisRow(Hypothesis.ALL_DRIFT, (1e-2, 1e-2, 1e-8, 1e-8)),\n"
BEFORE = "    # The tissue begun anew; see `change`. Always the last row but one.\n"

PROGRAM = """
import json
import numpy as np
import hc_estimator as hc
from hc_estimator.multiple_model.hypotheses import CODES, FRESH, ROWS, SURFACE_ROW
from hc_estimator.multiple_model.records import ROW_COUNT

time = np.arange(700) / 100.0
depth = 3.0 + 2.0 * np.sin(2.0 * np.pi * 0.7 * time)
velocity = 2.8 * np.pi * np.cos(2.0 * np.pi * 0.7 * time)
stiffness = 0.4 * np.exp(0.5 * np.sin(0.9 * time))  # it varies along the way
force = stiffness * depth**1.6 * (1.0 + 0.04 * velocity)
rng = np.random.default_rng(1)
estimator = hc.create_estimator("self_tuning_ukf", channel_delay=0.0)
found = estimator.run(
    time,
    depth + 0.005 * rng.standard_normal(time.size),
    force + 0.01 * rng.standard_normal(time.size),
)
new = estimator.state()["memory"]["rows"][FRESH - 1]
print(json.dumps({
    "rows": ROW_COUNT,
    "last": ROWS[FRESH].hypothesis.name,
    "surface": ROWS[SURFACE_ROW].hypothesis.name,
    "active": new["active"],
    "stiffness": float(np.exp(new["state"][2])),
    "given": float(found.parameters[-1, 0]),
    "true": float(stiffness[-1]),
}))
"""


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_one_line_in_one_file_is_enough(tmp_path):
    package = tmp_path / "hc_estimator"
    source = Path(hc_estimator.__file__).parent
    shutil.copytree(source, package, ignore=shutil.ignore_patterns("__pycache__"))
    table = package / "multiple_model" / "hypotheses.py"
    text = table.read_text()
    assert text.count(BEFORE) == 1
    table.write_text(text.replace(BEFORE, ROW + BEFORE))
    beside = Path(hc_msgs_py.__file__).parents[1]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join([str(tmp_path), str(beside)]),
    }
    ended = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=environment,
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    found = json.loads(ended.stdout)
    assert found["rows"] == 13
    assert (found["last"], found["surface"]) == ("CHANGED", "SURFACE_MOVES")
    assert found["active"] == 1
    assert abs(found["stiffness"] / found["true"] - 1.0) < 0.1
    assert abs(found["given"] / found["true"] - 1.0) < 0.1
