"""Threads and processes of a host: same answers, its streams are its own, objects travel."""

import os
import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from sealag.design import load

HERE = str(Path(__file__).parent)
DESIGNS = ("anymal", "baxter")


def answers(name):
    """What the library says of an example, as numbers."""
    system = load(EXAMPLES / f"{name}.toml")
    return told(system)


def told(system):
    certificate = sealag.certify(system)
    run = sealag.simulate(system, duration=0.02)
    margin = system.local_margins()
    return certificate.answer.max_delay_s, margin.delay_s, run.q.tobytes(), run.tau_sea.tobytes()


def test_threads_and_processes_answer_alike():
    names = DESIGNS * 2
    alone = {name: answers(name) for name in DESIGNS}
    with ThreadPoolExecutor(4) as threads:
        assert list(threads.map(answers, names)) == [alone[name] for name in names]
    words = "import pickle, sys, test_host_process as here; pickle.dump(here.answers(sys.argv[1]), "
    others = [
        subprocess.Popen(
            [sys.executable, "-c", words + "sys.stdout.buffer)", name],
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": os.pathsep.join([HERE, *sys.path])},
        )
        for name in DESIGNS
    ]
    answered = [pickle.loads(other.communicate(timeout=120)[0]) for other in others]
    assert answered == [alone[name] for name in DESIGNS]


def test_threads_may_share_a_design():
    """Scratch memory is each thread's own; one for all mixes their configurations."""
    system = load(EXAMPLES / "anymal.toml")
    rng = np.random.default_rng(20161115)
    postures = [system.robot.integrate(system.posture, 0.2 * rng.normal(size=18)) for _ in range(8)]

    def terms(q):
        return [
            (at.M.copy(), at.com.copy())
            for at in (system.robot.workspace_at(q) for _ in range(300))
        ]

    alone = [terms(q)[0] for q in postures]
    with ThreadPoolExecutor(8) as threads:
        for found, (M, com) in zip(threads.map(terms, postures), alone, strict=True):
            assert all((one == M).all() and (place == com).all() for one, place in found)


def test_standard_error_is_the_host_s_while_robots_load():
    """Every line that another thread writes arrives, and the parser adds none."""
    program = """
import os, sys, threading, sealag
from pathlib import Path
bad, good = (Path(name) for name in sys.argv[1:])
done = threading.Event()
def write():
    for k in range(3000):
        os.write(2, b"line %d\\n" % k)
    done.set()
threading.Thread(target=write).start()
count = 0
while not done.is_set() or count < 3:
    sealag.load_robot(good, floating_base=False)
    count += 1
try:
    sealag.load_robot(bad, floating_base=False)
except sealag.errors.RobotError as error:
    print(error)
"""
    folder = EXAMPLES.parent / "tests" / "data" / "cases"
    bad = folder.parent / "unknown_joint_type.urdf"
    done = subprocess.run(
        [sys.executable, "-c", program, str(bad), str(folder / "one.urdf")],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stderr.splitlines() == [f"line {k}" for k in range(3000)]
    assert "Joint [j] has no known type [weird]" in done.stdout


def test_what_a_host_holds_can_be_pickled():
    system = load(EXAMPLES / "anymal.toml")
    at = system.robot.workspace_at(system.posture, np.linspace(0.0, 1.0, system.robot.nv))
    again = pickle.loads(pickle.dumps(at))
    np.testing.assert_array_equal(again.M, at.M)
    np.testing.assert_array_equal(again.nle, at.nle)
    copy = pickle.loads(pickle.dumps(system))
    np.testing.assert_array_equal(copy.spaces().F_theta, system.spaces().F_theta)


@pytest.mark.skipif(not os.path.isdir("/proc/self/fd"), reason="counts open files in /proc")
def test_no_file_stays_open():
    system = load(EXAMPLES / "baxter.toml")
    told(system)
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        told(load(EXAMPLES / "baxter.toml"))
    assert len(os.listdir("/proc/self/fd")) == before


def test_ctrl_c_at_any_instant_ends_a_run_and_nothing_else():
    """Raised inside a compiled call, KeyboardInterrupt crashes: one in three did."""
    program = """
import signal, sys
from sealag.design import load
import sealag
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where tests run in background
system = load(sys.argv[1])
sealag.simulate(system, duration=0.01)
signal.signal(signal.SIGALRM, lambda *_: signal.raise_signal(signal.SIGINT))
armed = set()
def begun(t):
    if k not in armed:
        armed.add(k)
        signal.setitimer(signal.ITIMER_REAL, 0.01 + 0.00137 * k)
for k in range(40):
    print(sealag.simulate(system, duration=60.0, progress=begun).outcome.value)
assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
mine = lambda *_: print("mine")
signal.signal(signal.SIGINT, mine)
signal.setitimer(signal.ITIMER_REAL, 0.1)
print(sealag.simulate(system, duration=2.0).outcome.value)
assert signal.getsignal(signal.SIGINT) is mine
"""
    done = subprocess.run(
        [sys.executable, "-c", program, str(EXAMPLES / "baxter.toml")],
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["interrupted"] * 40 + ["mine", "completed"]
