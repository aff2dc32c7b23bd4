"""Where a controller and what it controls meet: one measurement in, one torque command out.

The simulator and a real robot's driver call the same two methods of the same object, so what is
certified and simulated is what runs.
"""

from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np

from sealag.errors import InputError
from sealag.typing import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Measurement:
    """What the central controller has received: one row of memory and named views into it.

    The storage is allocated once; a link overwrites ``data`` in place and every view follows. A
    row is what travels, so every entry of one measurement was sampled at the same instant.

    Attributes:
        data: The row (1 + nq + nv + 3 n + c,): time, q, v, theta, theta_dot, tau_sea, contact.
        q: Configuration (nq,): base position and quaternion x, y, z, w when the base floats,
            then link-side joint positions in rad.
        v: Tangent velocity (nv,): base linear and angular velocity in the base frame, then
            joint rates in rad/s.
        theta: Motor angles reflected to the joint side (n,), rad.
        theta_dot: Motor velocities (n,), rad/s.
        tau_sea: Spring torques (n,), Nm.
        contact: 1.0 where a foot is loaded, 0.0 where it is not (c,), in the order of the feet
            that the simulator or driver was given.
    """

    data: Array
    q: Array
    v: Array
    theta: Array
    theta_dot: Array
    tau_sea: Array
    contact: Array

    @classmethod
    def allocate(cls, *, nq: int, nv: int, n: int, contacts: int = 0) -> Self:
        """Return a zeroed measurement that owns its memory.

        Args:
            nq: Length of the configuration.
            nv: Length of the tangent velocity.
            n: Number of actuated joints.
            contacts: Number of contact flags.

        Raises:
            InputError: A size is negative, or n exceeds nv.
        """
        if min(nq, nv, n, contacts) < 0 or n > nv:
            raise InputError(
                f"measurement sizes must satisfy 0 <= n <= nv and contacts >= 0, "
                f"got nq={nq}, nv={nv}, n={n}, contacts={contacts}"
            )
        data = np.zeros(1 + nq + nv + 3 * n + contacts)
        ends = np.cumsum([1, nq, nv, n, n, n, contacts])
        _, q, v, theta, theta_dot, tau_sea, contact = np.split(data, ends[:-1])
        return cls(
            data=data,
            q=q,
            v=v,
            theta=theta,
            theta_dot=theta_dot,
            tau_sea=tau_sea,
            contact=contact,
        )

    @property
    def time(self) -> float:
        """Instant at which this measurement was sampled, s."""
        return float(self.data[0])

    @property
    def q_joint(self) -> Array:
        """Link-side joint positions (n,), rad: the last n entries of ``q``."""
        return self.q[self.q.size - self.theta.size :]

    @property
    def v_joint(self) -> Array:
        """Link-side joint rates (n,), rad/s: the last n entries of ``v``."""
        return self.v[self.v.size - self.theta.size :]


class TickController(Protocol):
    """A controller that is called once per period of the central loop.

    One that also has `storage`, as `Controller.storage`, states the potential that it stores, which
    the passivity observer needs; one that has `tank_energy`, J, states what its tank holds. One
    that has `state_space`, with `A`, `B`, `C`, `D` of n positions, then n rates, of the links
    if `of_links` is true, else of the motors, and their `period`, s, 0 in continuous time, states
    all that it does about the motor angles `theta` (n,): `freeze` does not differentiate it.
    """

    def reset(self, t: float, measurement: Measurement) -> None:
        """Forget the past and prepare for a run that begins in this state.

        Args:
            t: First instant of the run, s.
            measurement: The state at that instant, not delayed.
        """
        ...

    def tick(self, t: float, measurement: Measurement, out: Array) -> None:
        """Compute the command tau_osc of Eqs. (11), (17).

        Args:
            t: The controller's own clock, s.
            measurement: The newest measurement that has arrived; read only, overwritten before
                the next call. ``t - measurement.time`` is its age.
            out: Where the command (n,) is written, Nm.
        """
        ...
