"""Joint PD for a bandwidth and a damping ratio: kp = m ω², kd = 2 ζ m ω less the motor's own."""

from dataclasses import replace

import numpy as np

from sealag.design import System
from sealag.errors import InputError
from sealag.robot import Motion
from sealag.tune._gains import rounded
from sealag.tune._write import base_damping, damps_late
from sealag.typing import Array
from sealag.whole_body import FrozenLoop


def joint_inertia(system: System, motion: Motion | None) -> Array:
    """Return the inertia m that each joint's torque meets, motor included, (n,) kg m².

    1 / (Z (Zᵀ M Z)⁻¹ Zᵀ)_jj + B_s: links that contacts leave free, the other joints without torque;
    the largest over the motion, so that no instant is slower than asked.

    Args:
        system: the design.
        motion: its instants; the posture if None.

    Raises:
        InputError: contacts lock a joint.
    """
    along = system.still() if motion is None else motion
    gravity, robot = system.spaces(along).gravity, system.robot
    most = np.zeros(robot.n)
    for k in range(len(along)):
        contacts = along.contact_sets[along.contact_index[k]]
        links = FrozenLoop.free_links(robot, along.q[k], gravity[k], contacts=contacts)
        rows = links.Z[robot.nv_base :]
        mobility = np.einsum("ij,ij->i", rows, np.linalg.solve(links.M, rows.T).T)
        if (mobility <= 0.0).any():
            joint = robot.joints[int(mobility.argmin())]
            raise InputError(f"Contacts lock {joint}, which has no bandwidth; tune stiffness.")
        most = np.maximum(most, 1.0 / mobility)
    return most + system.actuators.shaped_inertia


def pd_design(system: System, inertia: Array, bandwidth: float, damping_ratio: float) -> System:
    """Return the design with the gains of a bandwidth, in few digits.

    Args:
        system: a design under joint PD.
        inertia: (n,) kg m².
        bandwidth: ω, rad/s.
        damping_ratio: ζ.
    """
    wanted = 2.0 * damping_ratio * bandwidth * inertia
    task, drives, base = system.law.tasks[0], system.actuators, base_damping(system)
    task = replace(task, stiffness=bandwidth**2 * inertia)
    if damps_late(system):
        task = replace(task, damping=np.maximum(wanted - base, 0.0))
        law = replace(system.law, tasks=(task,))
        return rounded(replace(system, law=law))
    law = replace(system.law, tasks=(task,))
    drives = replace(drives, motor_damping=np.maximum(wanted, base))
    return rounded(rounded(replace(system, law=law, actuators=drives)), up=True)
