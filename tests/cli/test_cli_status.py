"""Exit statuses: 0 yes, 1 a decided no, 2 wrong input or output, 3 the tool failed, 130 Ctrl-C."""

import json
import os
import subprocess
import sys
import tomllib

import pytest

from helpers.designs import EXAMPLES
from sealag.errors import (
    CertificateError,
    ContractionError,
    FileError,
    InputError,
    SolverError,
    UnknownNameError,
)

HELD = str(EXAMPLES / "hume_held.toml")
ALONE = (sys.executable, "-m", "sealag")

COMMANDS = {
    "init": (["init", "robot.urdf"], "sealag.design.starter_project"),
    "certify": (["certify", HELD], "sealag.design.load"),
    "margin": (["margin", HELD], "sealag.design.load"),
    "tune": (["tune", HELD], "sealag.design.load"),
    "verify": (["verify", "c.json"], "sealag.passivity.Certificate.verify"),
    "simulate": (["simulate", HELD], "sealag.design.load"),
    "cite": (["cite"], "importlib.resources.files"),
    "paper": (["paper"], "humanoids2016.reproduce"),
}
ENDS = {
    InputError("the posture is wrong"): 2,
    FileError("no such file"): 2,
    CertificateError("no certificate"): 2,
    ContractionError("springs too soft"): 2,
    UnknownNameError("no such joint"): 2,
    SolverError("no convergence"): 3,
    ZeroDivisionError("division\nby zero"): 3,
    KeyError("J_star"): 3,
    MemoryError(): 3,
    RecursionError("too deep"): 3,
    KeyboardInterrupt(): 130,
}


@pytest.mark.parametrize("error", ENDS, ids=lambda error: type(error).__name__)
@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_ends_with_the_status_of_its_problem(command, error, monkeypatch, cli):
    arguments, function = COMMANDS[command]

    def fails(*_arguments, **_options):
        raise error

    monkeypatch.setattr(function, fails)
    code, out, err = cli(*arguments)
    assert (code, out) == (ENDS[error], "")
    assert err.startswith("sealag: ")
    assert err.strip().count("\n") == 0
    if ENDS[error] == 3 and not isinstance(error, SolverError):
        assert "the tool itself failed" in err
        assert type(error).__name__ in err


def test_yes_and_no_are_the_controls(tmp_path, cli):
    out = tmp_path / "c.json"
    assert cli("certify", HELD, "--out", out)[0] == 0
    assert cli("verify", out)[0] == 0
    assert cli("margin", HELD)[0] == 0
    data = json.loads(out.read_text())
    out.write_text(json.dumps({**data, "delay_s": 10.0}))
    assert cli("verify", out)[0] == 1
    assert cli("certify", "bundled:hume", "--out", out)[0] == 1
    code, text, _ = cli("verify", out)
    assert code == 0
    assert text.endswith("the certificate holds: as it states, the design is not certified\n")
    assert json.loads(cli("verify", out, "--json")[1])["status"] == "not_certified"
    assert cli("certify", tmp_path / "none.toml", "--out", out)[0] == 2


EARLY = """
import runpy
import sys

class Stop:
    def find_spec(self, name, path=None, target=None):
        if name == "sealag.cli":
            raise KeyboardInterrupt

sys.meta_path.insert(0, Stop())
runpy.run_module("sealag", run_name="__main__")
"""


def test_ctrl_c_while_the_command_line_loads_is_told():
    done = subprocess.run(
        [sys.executable, "-c", EARLY, "cite"], capture_output=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (130, b"")
    assert done.stderr == b"sealag: interrupted\n"
    scripts = tomllib.loads((EXAMPLES.parent / "pyproject.toml").read_text())["project"]["scripts"]
    assert scripts == {"sealag": "sealag.__main__:main"}


def test_an_answer_that_nobody_can_read_is_no_yes(tmp_path):
    """A reader that went away, a full disk: neither 0 nor 1, and nothing but the status."""
    command = [*ALONE, "certify", HELD, "--out", str(tmp_path / "c.json")]
    good = subprocess.run(command, capture_output=True, timeout=300, check=False)
    assert good.returncode == 0
    with open("/dev/full", "w") as full:
        for words in (command[len(ALONE) :], ["cite"], ["--help"]):
            done = subprocess.run(
                [*ALONE, *words], stdout=full, stderr=subprocess.PIPE, timeout=300, check=False
            )
            assert done.returncode == 2
            said = b"sealag: the answer cannot be written: No space left on device.\n"
            assert done.stderr == said
        for words, status in (["certify", "none.toml"], 2), (["frobnicate"], 2), (["cite"], 0):
            done = subprocess.run(
                [*ALONE, *words], stdout=subprocess.PIPE, stderr=full, timeout=300, check=False
            )
            assert done.returncode == status
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, timeout=300, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (2, b"")
