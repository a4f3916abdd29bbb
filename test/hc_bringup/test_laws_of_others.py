"""Contact laws and tissues from packages outside the tree: compiled in, and never stale."""

import json
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.process
Installer = Callable[[Path, str, str], None]
Runner = Callable[..., subprocess.CompletedProcess[str]]

LAW = """
import math
from hc_estimator.compilation import compiled
from hc_estimator.contact.law import ESTIMATED, ContactLaw

@compiled
def force(d, v, K, B, n, p):
    return FACTOR * K * math.expm1(min(n * d, 50.0)) + B * v if d > 0.0 else 0.0

LAW = ContactLaw(force, "F = K (exp(n d) - 1) + B v", fixed=(ESTIMATED, ESTIMATED, ESTIMATED, 1.0))
"""


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_contact_law_of_another_package_is_compiled_and_never_stale(
    tmp_path: Path, install: Installer, run: Runner
) -> None:
    """One file and one line: its force, a gradient by differences, what it lacks; edits count."""
    points = "[hc.contact_laws]\nfung = fung:LAW\nbad = nowhere:LAW\nodd = os:path\n"
    install(tmp_path, "fung", points)
    code = (
        "import numpy as np; from hc_estimator.contact import registry as r; "
        "from hc_estimator import available_contact_models; m = r.CONTACT_MODELS.index('fung'); "
        "g = np.zeros(6); at = (0.5, 2.0, 0.3, 0.05, 1.5, 1.0); "
        "r.contact_gradient(m, *at, g); print(r.contact_force(m, *at), *g); "
        "print(r.contact_force(m, 0.5, -99.0, 0.3, 0.05, 1.5, 1.0), r.fixed_value(m, 3)); "
        "print(available_contact_models('ekf')[-1], r.PROBLEMS)"
    )
    for factor in (1.0, 2.0):
        (tmp_path / "fung.py").write_text(LAW.replace("FACTOR", str(factor)))
        done = run(tmp_path, "-c", code)
        assert done.returncode == 0, done.stderr
        lines = done.stdout.splitlines()
        told = [float(word) for word in lines[0].split()]
        rise = factor * np.expm1(0.75)
        slope = factor * 0.3 * np.exp(0.75)
        expected = [0.3 * rise + 0.1, 1.5 * slope, 0.05, rise, 2.0, 0.5 * slope, 0.0]
        assert told == pytest.approx(expected, rel=1e-6, abs=1e-8)
        assert lines[1] == "0.0 1.0"  # it does not pull, and has no p
        assert lines[2].startswith("fung {")
        assert "'bad': \"nowhere:LAW: ModuleNotFoundError" in lines[2]
        assert "os:path is a module, no ContactLaw" in lines[2]


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_recording_is_estimated_with_a_law_of_another_package(
    tmp_path: Path, install: Installer, run: Runner
) -> None:
    install(tmp_path, "fung", "[hc.contact_laws]\nfung = fung:LAW\n")
    (tmp_path / "fung.py").write_text(LAW.replace("FACTOR", "1.0"))
    time_s = np.arange(0.0, 6.0, 0.002)
    depth = 1.5 - 1.2 * np.cos(4.0 * time_s)
    force = 0.2 * np.expm1(0.8 * depth) + 0.03 * 4.8 * np.sin(4.0 * time_s)
    noise = 0.01 * np.random.default_rng(1).standard_normal(time_s.size)
    rows = "\n".join(f"{t},{d},{f}" for t, d, f in zip(time_s, depth, force + noise, strict=True))
    (tmp_path / "presses.csv").write_text(f"time_s,displacement_mm,force_N\n{rows}\n")
    words = ("estimate", "presses.csv", "--filter", "ekf", "--contact-model", "fung", "--json")
    done = run(tmp_path, "-m", "hc_bringup", *words)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)["parameters"]
    assert found["stiffness"] == pytest.approx(0.2, rel=0.1)
    assert found["damping"] == pytest.approx(0.03, rel=0.1)
    assert found["displacement_exponent"] == pytest.approx(0.8, rel=0.1)
    assert found["velocity_exponent"] == 1.0


TISSUE = """
import math
from hc_sim_rig.compilation import compiled
from hc_sim_rig.tissues_of_others import TissueEntry

@compiled
def force(d, v, K, B, n, p, inner, rates):
    rates[0] = (max(d, 0.0) - inner[0]) / 0.2
    return FACTOR * K * math.expm1(min(n * d, 50.0)) + B * (d - inner[0]) if d > 0.0 else 0.0

TISSUE = TissueEntry(
    force, "K (exp(n d) - 1) and a spring that relaxes", ("stiffness", "damping", HAS)
)
"""
OF_TISSUE = """
description: presses once and holds
duration_s: 4.0
drive:
  kind: stage
  motion: {kind: waypoints, shape: minimum_jerk, points: [[0.0, -1.0], [1.0, 2.0], [4.0, 2.0]]}
tissue: {kind: fung, stiffness: 0.3, damping: 0.5, displacement_exponent: 0.8}
"""


def test_a_tissue_that_cannot_be_used_says_why_and_disturbs_nobody(
    tmp_path: Path, install: Installer, run: Runner
) -> None:
    points = "[hc.tissues]\nfung = nowhere:TISSUE\nodd = os:path\nlayered = os:path\n"
    install(tmp_path, "a", points)
    (tmp_path / "hold.yaml").write_text(OF_TISSUE)
    done = run(tmp_path, "-m", "hc_bringup", "simulate", "hold.yaml", "-o", "a.csv")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "tissue fung cannot be used: nowhere:TISSUE: ModuleNotFoundError" in done.stderr
    code = (
        "from hc_sim_rig import load_scenario; from hc_sim_rig.tissues_of_others import PROBLEMS; "
        "print(load_scenario('layered_tissue.yaml').tissue.kind, PROBLEMS)"
    )
    layered = OF_TISSUE.replace("{kind: fung, stiffness: 0.3, damping: 0.5", "{kind: none} #")
    (tmp_path / "layered_tissue.yaml").write_text(layered)
    done = run(tmp_path, "-c", code)
    assert done.returncode == 0, done.stderr
    assert "'layered': 'a tissue of that name is there already, not os:path'" in done.stdout
    assert "'odd': 'os:path is a module, no TissueEntry'" in done.stdout


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_a_tissue_of_another_package_is_pressed_and_never_stale(
    tmp_path: Path, install: Installer, run: Runner
) -> None:
    install(tmp_path, "fung", "[hc.tissues]\nfung = fung:TISSUE\n")
    (tmp_path / "hold.yaml").write_text(OF_TISSUE)
    wrong = OF_TISSUE.replace("displacement_exponent", "velocity_exponent")
    (tmp_path / "wrong.yaml").write_text(wrong)
    code = (
        "import json; from hc_sim_rig import Rig, load_scenario, settings_of; "
        "s = load_scenario('hold.yaml'); t = Rig(s).run(4.0).truth; "
        "print(json.dumps([t.displacement_mm.tolist(), t.force_n.tolist(), "
        "t.parameters[-1].tolist(), [n for n in settings_of(s) if 'exponent' in n]]))"
    )
    for factor in (1.0, 2.0):
        text = TISSUE.replace("FACTOR", str(factor)).replace("HAS", "'displacement_exponent'")
        (tmp_path / "fung.py").write_text(text)
        done = run(tmp_path, "-c", code)
        assert done.returncode == 0, done.stderr
        depth, force, known, exponents = json.loads(done.stdout)
        assert depth[-1] == pytest.approx(2.0, abs=1e-6)
        spring = factor * 0.3 * np.expm1(0.8 * 2.0)
        assert force[-1] == pytest.approx(spring, rel=1e-6)  # 15 time constants later
        assert max(force) > spring + 0.2  # the rest has relaxed
        assert force[0] == 0.0
        assert known[:3] == [0.3, 0.5, 0.8]
        assert np.isnan(known[3])
        assert exponents == ["displacement_exponent"]
    command = ("-m", "hc_bringup", "simulate", "wrong.yaml", "-o", "a.csv")
    told = run(tmp_path, *command).stderr
    assert "velocity_exponent is given, which the tissue fung does not have" in told
    done = run(tmp_path, "-m", "hc_bringup", "simulate", "hold.yaml", "-o", "a.csv")
    assert done.returncode == 0, done.stderr
