"""The least inertia shaping β that loop rate and torque noise allow (docs/theory section 16.5)."""

from dataclasses import replace

import numpy as np

from sealag.tune._answer import Tuned
from sealag.tune._gains import floored
from sealag.tune._passive import EASE
from sealag.tune._question import Limit, Question


def least_shaping(question: Question) -> Tuned:
    """Return the design with the least β = B_s / B of each joint.

    D_θ T_e / B_s < 2 keeps damping stable that a drive computes once in T_e, and noise of the
    measured torque comes back |B / B_s − 1| times as large. Safety stretches T_e.

    Args:
        question: its embedded period, and its limit of noise if it has one.
    """
    system, drives = question.system, question.system.actuators
    safety = question.required / system.delays.d_1
    period = safety * system.delays.embedded_period
    by_rate = drives.motor_damping * period / (2.0 * drives.rotor_inertia) * (1.0 + EASE)
    gain = question.limits.get(Limit.NOISE, np.inf)
    shaping = -floored(-np.maximum(by_rate, 1.0 / (1.0 + gain)))
    worst = int(by_rate.argmax())
    joint = drives.joints[worst]
    if gain < 1.0 and shaping[worst] > 1.0 / (1.0 - gain):
        return Tuned.none(
            question,
            f"the embedded period asks for the inertia shaping {shaping[worst]:.6g} of {joint}, "
            f"which makes more than {gain:g} of the torque's noise",
        )
    shaped = replace(drives, shaped_inertia=shaping * drives.rotor_inertia)
    tuned = Tuned.of(question, replace(system, actuators=shaped))
    if tuned.binding is None:
        return tuned
    kind = "period" if by_rate[worst] >= 1.0 / (1.0 + gain) else "noise"
    binding = replace(tuned.binding, kind=kind, joint=joint, joints={joint: 1.0})
    return replace(tuned, binding=binding)
