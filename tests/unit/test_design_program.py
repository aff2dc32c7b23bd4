"""controller.kind = "python": a function of the user's own makes what ticks."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.toml import to_toml
from sealag.design import System, load
from sealag.errors import InputError, SealagError
from sealag.simulation import Outcome

ARM = """
import numpy as np

class PD:
    def __init__(self, system):
        robot, q = system.robot, system.posture
        self.gravity = robot.gravity(q)
        self.target = q + self.gravity / system.actuators.spring_stiffness

    def reset(self, t, measurement):
        pass

    def tick(self, t, measurement, out):
        out[:] = {kp} * (self.target - measurement.theta) - {kd} * measurement.theta_dot
        out += self.gravity

def controller(system):
    return PD(system)
"""


def written(folder, controller):
    """The Panda under another controller."""
    data = tomllib.loads((EXAMPLES / "panda.toml").read_text())
    path = folder / "arm.toml"
    path.write_text(to_toml({**data, "controller": controller}))
    return path


def project(folder, program=ARM, *, kp=400.0, kd=10.0, **keys):
    """The Panda under a program."""
    (folder / "mine.py").write_text(program.replace("{kp}", str(kp)).replace("{kd}", str(kd)))
    return written(folder, {"kind": "python", "file": "mine.py", **keys})


def test_its_margins_are_those_of_the_same_law(tmp_path):
    mine = load(project(tmp_path)).local_margins()
    pd = {"kind": "joint_pd", "gravity": "planned", "kp": 400.0, "kd": 10.0}
    law = load(written(tmp_path, pd)).local_margins()
    assert mine.delay_s == pytest.approx(law.delay_s, rel=1e-6)
    assert mine.jitter_s == pytest.approx(law.jitter_s, rel=1e-4)
    assert mine.channels_s == pytest.approx(dict(law.channels_s), rel=1e-6)
    other = load(project(tmp_path, kd=5.0)).local_margins()
    assert other.delay_s > 1.05 * mine.delay_s


def test_it_runs_in_the_simulator(tmp_path):
    run = sealag.simulate(load(project(tmp_path)), scenario="regulate", duration=0.1)
    assert run.outcome is Outcome.COMPLETED
    np.testing.assert_allclose(run.v, 0.0, atol=1e-6)
    assert run.audit.controller_side is None  # it states no potential


def test_rates_of_sampling_are_answered(tmp_path):
    rates = load(project(tmp_path)).rate_sweep([200.0, 5000.0])
    assert rates[0].stable is False


@pytest.mark.parametrize("ask", ["certify", "spaces", "track"])
def test_what_needs_a_law_is_refused(tmp_path, ask):
    system = load(project(tmp_path))
    questions = {
        "certify": lambda: sealag.certify(system),
        "spaces": system.spaces,
        "track": lambda: sealag.simulate(system, scenario="track", duration=0.1),
    }
    with pytest.raises(InputError, match=r"the controller of arm is a program"):
        questions[ask]()


def test_a_motion_is_refused(tmp_path):
    system = load(project(tmp_path))
    still = system.still()
    two = replace(
        still, time=np.array([0.0, 1.0]), q=np.repeat(still.q, 2, axis=0),
        v=np.repeat(still.v, 2, axis=0), contact_index=np.zeros(2, dtype=int),
    )  # fmt: skip
    with pytest.raises(InputError, match="leave the motion out"):
        system.local_margins(two)


@pytest.mark.parametrize(
    ("program", "keys", "words"),
    [
        (ARM, {"file": "other.py"}, "controller.file.*there is no file"),
        (ARM, {"function": "make"}, "has no function make"),
        ("import nothing_of_that_name", {}, "raises ModuleNotFoundError"),
        ("def controller(", {}, "raises SyntaxError"),
        (ARM, {"gain": 3.0}, "controller.gain is not known"),
    ],
)
def test_a_file_that_is_no_program_is_named(tmp_path, program, keys, words):
    with pytest.raises(SealagError, match=words) as refused:
        load(project(tmp_path, program, **keys))
    assert str(refused.value).count("\n") == 0


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("def controller(system):\n    return None", "returns has no reset"),
        ("def controller(system):\n    return 1 / 0", "raises ZeroDivisionError"),
        ("def controller():\n    return 1", "raises TypeError"),
        (ARM.replace("+ self.gravity /", "+ 0.5 + self.gravity /"), "does not hold the state"),
        (ARM.replace("out[:] =", "self.sum = getattr(self, 'sum', 0) + 1\n        out[:] = "
                     "self.sum +"), "does not settle"),
    ],
)  # fmt: skip
def test_a_program_that_cannot_be_frozen_is_told_why(tmp_path, program, words):
    with pytest.raises(InputError, match=words):
        load(project(tmp_path, program)).local_margins()


@pytest.mark.parametrize("ask", [System.local_margins, sealag.simulate])
@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("raise KeyError('knee')", "tick in .*mine.py raises KeyError: 'knee'"),
        ("raise SystemExit(0)", "tick in .*mine.py raises SystemExit: 0"),
        ("out[:] = measurement.rates", "mine.py raises AttributeError"),
    ],
)
def test_what_a_tick_raises_is_the_program_s(tmp_path, ask, line, words):
    """It is wrong input, not a failure of the tool, and never a silent end."""
    system = load(
        project(tmp_path, ARM.replace("out[:] = {kp}", f"{line}\n        out[:] = {{kp}}"))
    )
    with pytest.raises(InputError, match=words):
        ask(system)


def test_a_file_that_leaves_is_named(tmp_path):
    with pytest.raises(InputError, match=r"mine\.py raises SystemExit"):
        load(project(tmp_path, "import sys\nsys.exit()"))


def test_what_else_a_controller_states_is_asked_of_it(tmp_path):
    """The simulator asks for a storage, `freeze` for a state space."""
    stated = ARM.replace("self.gravity =", "self.storage = self.gravity =", 1)
    controller = load(project(tmp_path, stated)).controller()
    np.testing.assert_array_equal(controller.storage, controller.gravity)
    assert not hasattr(controller, "tank_energy")
