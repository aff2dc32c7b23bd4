"""The plant's books: what every mechanism has done so far, added up step by step."""

import numpy as np

from sealag.simulation._instant import Instant
from sealag.typing import Array

STORES = ("kinetic", "gravity", "spring", "motor")
JOINT_FLOWS = (
    "port",  # ∫ tau_sea q̇: springs to links
    "shaft",  # ∫ tau_sea θ̇: motors to springs
    "motor_work",  # ∫ tau_m θ̇
    "command",  # ∫ tau_osc θ̇
    "damping",  # ∫ D_theta θ̇²
    "viscous",
    "coulomb",
    "spring_damping",
    "joint_damping",  # of the bearings, on the links' side
)
SCALAR_FLOWS = ("holding", "sliding", "torsion", "disturbance", "impact")


class Ledger:
    """Cumulative works since the beginning of a run, J.

    Attributes:
        data: All of it in one row: joint, scalar, stores, throughput (9 n + 10,).
        joint: Rows as in JOINT_FLOWS (9, n).
        scalar: As in SCALAR_FLOWS (5,); the first four are works done on the robot, impact is lost.
        stores: Energies at the present instant as in STORES (4,).
        throughput: Sum of the absolute changes of the stores, J.
    """

    def __init__(self, parameters: Array) -> None:
        from sealag.kernels.motor import stores, tally

        self._tally, self._stores, self._parameters = tally, stores, parameters
        n = parameters.shape[0]
        self.data = np.zeros(sum(ledger_sizes(n)))
        joint, self.scalar, self.stores, self._moved = np.split(
            self.data, np.cumsum(ledger_sizes(n))[:-1]
        )
        self.joint = joint.reshape(len(JOINT_FLOWS), n)

    @property
    def throughput(self) -> float:
        """Energy moved between stores so far, J."""
        return float(self._moved[0])

    def begin(self, at: Instant) -> None:
        """Open empty books at an instant."""
        self.data[:] = 0.0
        self._stores(self._parameters, at.z, at.q, at.power, self.stores)

    def add(self, work: Array, powers: Array, step: float, at: Instant) -> None:
        """Book one step: joint works (n, 8), stage powers (4, 6), and the stores after it."""
        self._tally(
            self._parameters, work, powers, step, at.z, at.q, at.power,
            self.joint, self.scalar, self.stores, self._moved,
        )  # fmt: skip

    def strike(self, lost: float, at: Instant) -> None:
        """Book an impact: what its impulses took, and the stores after it."""
        self.scalar[4] += lost
        before = self.stores.copy()
        self._stores(self._parameters, at.z, at.q, at.power, self.stores)
        self._moved += np.abs(self.stores - before).sum()


def ledger_sizes(n: int) -> tuple[int, int, int, int]:
    """Return the lengths of joint works, other works, stores and throughput for n joints."""
    return len(JOINT_FLOWS) * n, len(SCALAR_FLOWS), len(STORES), 1


def residual(stores: Array, joint: Array, scalar: Array) -> Array:
    """Return energy present less energy expected from all works (N,), J, of logged books.

    Zero but for the integrator: stores (N, 4), joint works (N, 9, n) and other works (N, 5) come
    from separate integrals.
    """
    present = stores.sum(axis=1) - stores[:1].sum()
    works = joint.sum(axis=2)
    return (
        present - works[:, 2] + works[:, 5:].sum(axis=1) - scalar[:, :4].sum(axis=1) + scalar[:, 4]
    )
