"""What kernels are handed once, by `keep`: live in both directions, and freed with its owner."""

import gc
from dataclasses import replace

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

import sealag
from helpers.source import ROOT
from sealag.kernels import dynamics, keep
from sealag.robot import load_robot
from sealag.whole_body import Controller, Measurement, Signal

CALLS = 200


@pytest.fixture(autouse=True)
def counted():
    """Let Numba count what it allocates, as its own tests do."""
    _nrt_python.memsys_enable_stats()
    yield
    _nrt_python.memsys_disable_stats()


@pytest.fixture(scope="module")
def hume():
    """A robot with two feet."""
    return load_robot("bundled:hume.urdf", floating_base=True)


def _alive():
    """Pieces of memory that kernels hold."""
    gc.collect()
    stats = rtsys.get_allocation_stats()
    return stats.mi_alloc - stats.mi_free


def test_what_a_kernel_writes_is_seen_and_what_python_writes_is_read(hume):
    tree = hume.tree._replace(mass=hume.tree.mass.copy())
    terms = dynamics.allocate(tree)
    model, q, v = keep(dynamics.Model(tree, terms)), hume.neutral(), np.zeros(hume.nv)
    dynamics.evaluate(model, q, v)
    np.testing.assert_allclose(terms.M, hume.mass_matrix(q))
    before = terms.M[0, 0]
    tree.mass[1] += 2.0
    dynamics.evaluate(model, q, v)
    assert terms.M[0, 0] == pytest.approx(before + 2.0)


def test_memory_is_freed_with_the_last_owner(hume):
    """The control: what is still owned counts as alive."""
    before = _alive()
    owned = [hume.workspace() for _ in range(10)]
    assert _alive() >= before + 10
    del owned
    assert _alive() == before


@pytest.mark.parametrize("signal", ["motor", "static_joint_tank"])
def test_ticks_leave_nothing_behind(signal):
    system = sealag.load(str(ROOT / "examples/anymal.toml"))
    robot = system.robot
    controller = Controller(
        robot, replace(system.law, signal=Signal.named(signal)), system.actuators,
        contacts=system.contacts, posture=system.posture,
    )  # fmt: skip
    seen, out = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n), np.zeros(robot.n)
    seen.q[:] = system.posture
    seen.theta[:] = robot.joint_positions(system.posture)
    controller.reset(0.0, seen)
    controller.tick(0.0, seen, out)
    before = _alive()
    for k in range(CALLS):
        controller.tick(1e-3 * k, seen, out)
    assert _alive() == before


def test_a_run_leaves_nothing_behind():
    system = sealag.load("bundled:hume")
    sealag.simulate(system, scenario="drop", duration=0.05)
    before = _alive()
    for _ in range(3):
        sealag.simulate(system, scenario="drop", duration=0.05)
    assert _alive() == before
