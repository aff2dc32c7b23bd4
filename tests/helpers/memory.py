"""Resident memory that many ticks of a controller leave behind, in a process of their own.

`python -m helpers.memory anymal` ticks `sealag.Controller`, `… hume` the walking controller through
step after step; `… leaking` loses 64 bytes a tick besides on the heap of C, which no Python tool
sees. It prints the growth over the ticks after the first ones, carried on to an hour, in bytes.
"""

import ctypes
import resource
import sys
from dataclasses import replace

import numpy as np

from helpers.designs import EXAMPLES
from sealag.design import load
from sealag.walking import GroundProfile
from sealag.whole_body import Controller, Measurement, Tank

WARM, TICKS = 6_000, 10_000
"""Ticks before the measured ones, in which kernels are loaded one by one, and measured ticks."""
GAPS = 2_000
"""Blocks of each small size that are taken before the measured ticks, 68 MB in all."""
HOUR = 3_600_000
"""Ticks of a 1 kHz controller."""


def standing():
    """Return ANYmal's controller and what it measures."""
    system = load(EXAMPLES / "anymal.toml")
    controller = Controller(
        system.robot, replace(system.law, signal=Tank()), system.actuators,
        contacts=system.contacts, posture=system.posture,
    )  # fmt: skip
    return controller, _measured(system.robot, system.posture, np.zeros(system.robot.nv), 4)


def walking():
    """Return Hume's walking controller and the state at the apex, which it sees for ever."""
    system = load("bundled:hume")
    walk = replace(system.walking, ground=GroundProfile.flat())
    start = walk.begin(system.robot, system.actuators)
    measured = _measured(system.robot, start.q, start.v, 2)
    measured.contact[1] = 1.0
    return start.controller, measured


def _measured(robot, q, v, contacts):
    measured = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n, contacts=contacts)
    measured.q[:], measured.v[:] = q, v
    measured.theta[:] = measured.q_joint
    return measured


def growth(controller, measured, *, lost=0):
    """Return by how many bytes resident memory grows in the ticks after the first ones.

    Args:
        controller: what is ticked at 1 kHz.
        measured: what it sees, but for motor angles that sway.
        lost: bytes that are lost at each tick.
    """
    rest, out = measured.theta.copy(), np.zeros(measured.theta.size)
    libc = ctypes.CDLL(None)
    controller.reset(0.0, measured)
    before = 0
    for k in range(WARM + TICKS):
        if k == WARM:
            _fill_gaps(libc)
            before = _resident()
        measured.data[0] = 1e-3 * k
        measured.theta[:] = rest + 1e-3 * np.sin(0.01 * k)
        controller.tick(1e-3 * k, measured, out)
        if lost:
            libc.malloc(lost)
    return _resident() - before


def _fill_gaps(libc):
    """Take the free blocks that imports left on the heap: a leak would fill them unseen."""
    for size in range(16, 1040, 16):
        for _ in range(GAPS):
            libc.malloc(size)


def _resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


if __name__ == "__main__":
    controller, measured = standing() if sys.argv[1] == "anymal" else walking()
    found = growth(controller, measured, lost=64 if sys.argv[1] == "leaking" else 0)
    print(found * HOUR // TICKS)
