"""The energy tank, Eqs. (18)-(22): a task position x̂ whose moves are paid for."""

from enum import StrEnum
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from sealag.kernels.control_law import Tank


class TankFlow(StrEnum):
    """What the energy tank pays for while u moves x̂, with Q = S.

    published: Eq. (20), Ė = −½ d̄ uᵀ Q u − d̄ uᵀ Q J* θ̇, what u adds to V_4.
    corrected: Ė = x̃̂ᵀ S u − ½ d̄ uᵀ Q u − d̄ uᵀ Q J* θ̇, also what u adds to V_3 = ½ x̃̂ᵀ S x̃̂.

    Along x̂̇ = u + J* θ̇ and with d_1 ≤ d̄ ≤ 1 / w(D^-½ J*ᵀ S J* D^-½) the corrected flow makes
    V_1 + V_2 + V_3 + V_4 + E fall; with the published one it can rise by −x̃̂ᵀ S u.
    """

    PUBLISHED = "published"
    CORRECTED = "corrected"


class EnergyTank:
    """x̂̇ = u + J* θ̇, where u draws x̂ to x(q̄(θ)) and is 0 when the tank cannot pay for it.

    One step from tick to tick takes u as constant and the motor's move Δθ as measured, so that no
    drift comes from samples that are late, lost or uneven. V_3's change is then
    −x̃̂_mᵀ S (T u + J* Δθ) exactly, with T the period and x̃̂_m the error half-way, and the tank's is
    T x̃̂_mᵀ S u − ½ d̄ T uᵀ S u − d̄ uᵀ S J* Δθ (without the first term for the published flow).
    It is the energy that is integrated, and a step that would overdraw it is not taken: E ≥ 0.

    Where measurements are old by d_up, x̂ of a tick is x̂ of the instant of measurement, and u and
    the energy belong to that instant: the delay of x̂ as a whole is d_1, and the proof is the one
    without d_up with energies taken d_up later.
    """

    def __init__(
        self, *, rows: int, energy: float, rate: float, delay_bound: float, flow: TankFlow
    ) -> None:
        """Fill a tank.

        Args:
            rows: number of task rows m.
            energy: J at the start.
            rate: at which x̂ follows x(q̄(θ)) while the tank can pay, 1/s.
            delay_bound: d̄, s.
            flow: what the tank pays for.
        """
        self.rate, self.delay_bound, self.flow, self._first = rate, delay_bound, flow, energy
        self.position, self._energy = np.zeros(rows), np.full(1, energy)

    @property
    def memory(self) -> "Tank":
        """The tank as kernels take it; its arrays are live."""
        from sealag.kernels.control_law import Tank

        return Tank(
            position=self.position, energy=self._energy, rate=float(self.rate),
            delay_bound=float(self.delay_bound), corrected=self.flow is TankFlow.CORRECTED,
        )  # fmt: skip

    @property
    def can_pay(self) -> bool:
        """Whether a full tank moves x̂ at all."""
        return self._first > 0.0 and self.rate > 0.0

    @property
    def energy(self) -> float:
        """Energy left, J, never below 0."""
        return float(self._energy[0])

    def reset(self) -> None:
        """Fill the tank."""
        self._energy[0] = self._first
