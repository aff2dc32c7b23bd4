"""What Python offers: files where designs and motions are asked for, and `dir` of the package."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.small_systems import arm_system
from sealag.errors import FileError, InputError
from sealag.robot import Motion

HELD = EXAMPLES / "hume_held.toml"


def still_project(tmp_path):
    """Hume held by its torso, with a motion of its own in which one knee is bent."""
    system = sealag.load(HELD)
    q = np.tile(system.posture, (3, 1))
    q[:, system.robot.joints.index("right_knee")] += [0.0, 0.1, 0.2]
    motion = Motion(
        time=np.arange(3.0), q=q, v=np.zeros((3, system.robot.nv)),
        contact_sets=((),), contact_index=np.zeros(3, dtype=np.int64),
    )  # fmt: skip
    system.save_motion(motion, tmp_path / "knee.csv")
    path = tmp_path / "held.toml"
    path.write_text(HELD.read_text() + '\n[motion]\nfile = "knee.csv"\n')
    return path, motion


def delay(certificate):
    return certificate.answer.max_delay_s, certificate.question.instants


def test_a_file_is_certified_as_the_command_line_does(tmp_path, cli):
    path, motion = still_project(tmp_path)
    system = sealag.load(path)
    along = delay(sealag.certify(str(path)))
    assert along[1] == 3
    assert along == delay(sealag.certify(path)) == delay(sealag.certify(system))
    assert along == delay(sealag.certify(HELD, motion))
    assert along == delay(sealag.certify(HELD, tmp_path / "knee.csv"))
    assert along == delay(sealag.certify(HELD, str(tmp_path / "knee.csv")))
    assert delay(sealag.certify(system, system.still()))[1] == 1
    out = tmp_path / "c.json"
    assert cli("certify", path, "--out", out)[0] == 0
    assert delay(sealag.Certificate.read(out)) == along
    assert sealag.verify_design(out, path).valid
    assert sealag.verify_design(out, HELD, tmp_path / "knee.csv").checks
    assert system.local_margins().instants == 3
    assert system.local_margins(system.still()).instants == 1


def test_a_file_is_simulated(tmp_path):
    run = sealag.simulate(str(HELD), scenario="regulate", duration=0.01)
    assert run.outcome.value == "completed"


def test_what_is_neither_is_refused(tmp_path):
    system = arm_system(tmp_path)
    for wrong in (None, 3, {"robot": 1}):
        with pytest.raises(InputError, match="project"):
            sealag.certify(wrong)
    for wrong in (3, np.zeros((2, 2)), dataclasses):
        with pytest.raises(InputError, match="motion is"):
            sealag.certify(system, wrong)
    with pytest.raises(FileError, match=r"none\.toml"):
        sealag.certify("none.toml")


def test_dir_lists_what_there_is():
    """In a fresh process: names and rooms, and none of them loads anything until it is used."""
    code = (
        "import sealag, sys; names = dir(sealag); assert 'numpy' not in sys.modules;"
        "[getattr(sealag, name) for name in names];"
        "assert sealag.margin.DelayedLoop and callable(sealag.certify);"
        "assert not hasattr(sealag, 'certfy'); print(*names)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    names = set(done.stdout.split())
    assert set(sealag.__all__) | {"margin", "passivity", "errors", "simulation"} <= names
    assert not names & {"import_module", "Any", "TYPE_CHECKING", "_HOME"}
