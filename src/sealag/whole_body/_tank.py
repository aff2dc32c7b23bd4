"""The energy tank, Eqs. (18)-(22): a task position x̂ whose moves are paid for."""

from enum import StrEnum

import numpy as np

from sealag.typing import Array


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
        self, *, size: int, energy: float, rate: float, delay_bound: float, flow: TankFlow
    ) -> None:
        """Fill a tank.

        Args:
            size: number of task rows m.
            energy: J at the start.
            rate: at which x̂ follows x(q̄(θ)) while the tank can pay, 1/s.
            delay_bound: d̄, s.
            flow: what the tank pays for.
        """
        self._first, self.rate = energy, rate
        self._delay_bound, self._flow = delay_bound, flow
        self.position = np.zeros(size)
        self.energy = energy
        self.started = False

    @property
    def can_pay(self) -> bool:
        """Whether a full tank moves x̂ at all."""
        return self._first > 0.0 and self.rate > 0.0

    def reset(self) -> None:
        """Fill the tank and forget x̂."""
        self.energy, self.started = self._first, False

    def start(self, position: Array) -> None:
        """Begin at a task position.

        Args:
            position: (m,) x(q̄(θ)), from the posture's own.
        """
        self.position[:] = position
        self.started = True

    def step(
        self, period: float, moved: Array, *, wanted: Array, target: Array, stiffness: Array
    ) -> None:
        """Move x̂ over one period, and the energy with it.

        Args:
            period: T since the last step, s; at 0 or less u does nothing.
            moved: (m,) J* Δθ.
            wanted: (m,) x_d.
            target: (m,) x(q̄(θ)), which u moves x̂ to.
            stiffness: (m, m) S, symmetric.
        """
        if period > 0.0:
            # u of the exact solution of x̂̇ = rate (target − x̂), so that no period is too long.
            pull = -np.expm1(-self.rate * period) / period
            u = pull * (target - self.position - moved)
            force = stiffness @ u
            flow = -self._delay_bound * float(force @ (0.5 * period * u + moved))
            if self._flow is TankFlow.CORRECTED:
                half = wanted - self.position - 0.5 * (period * u + moved)
                flow += period * float(force @ half)
            if self.energy + flow >= 0.0:
                self.energy += flow
                self.position += period * u
        self.position += moved
