"""Model matrices that are updated more slowly than the controller ticks, Fig. 2."""

from typing import TYPE_CHECKING

from sealag.errors import InputError
from sealag.typing import Array
from sealag.whole_body._signals import Signal, Tank

if TYPE_CHECKING:
    from sealag.kernels.operational_space import Space

_SAME = 1e-9
"""s: ticks of a clock that counts in floats may be early by rounding."""


class HeldModel:
    """J* and S of the last update, which the law uses until the next one.

    x and ḡ are taken at each tick: τ_osc = J*ᵀ S x̃ + ḡ with J*, S of the update. Between updates
    −∂τ_osc/∂θ = J*_uᵀ S_u J*, which is symmetric only while J* stands still.
    """

    def __init__(self, period: float, signal: Signal) -> None:
        """Hold nothing yet.

        Args:
            period: s between two updates; 0 updates at each tick.
            signal: what is fed back.

        Raises:
            InputError: x̂ of the energy tank moves with J* of each tick.
        """
        if period > 0.0 and isinstance(signal, Tank):
            raise InputError(
                "The model's period is longer than a tick, but x̂ of the energy tank moves with J* "
                "of every tick; feed back motor, joint or static_joint, or leave "
                "simulation.model_period_ms out."
            )
        self.period = period
        self.reset()

    def reset(self) -> None:
        """Forget the last update."""
        self._updated, self._J, self._S = float("-inf"), None, None

    def update(self, t: float, space: "Space") -> None:
        """Take J* and S of a tick, if an update is due.

        Args:
            t: the controller's clock, s.
            space: of the law, evaluated.
        """
        if self.period > 0.0 and t - self._updated >= self.period - _SAME:
            self._updated = t
            self._J, self._S = space.J_star.copy(), space.stiffness.copy()

    def replace(self, space: "Space", error: Array, out: Array) -> float:
        """Put J* and S of the last update into a law that has been evaluated.

        Args:
            space: J_star and stiffness are written.
            error: (m,) x̃.
            out: (n,) its torque, changed by the tasks' part.

        Returns:
            By how much ½ x̃ᵀ S x̃ changes, J.
        """
        if self._J is None or self._S is None:
            return 0.0
        before = space.stiffness @ error
        out -= space.J_star.T @ before
        space.J_star[:], space.stiffness[:] = self._J, self._S
        after = self._S @ error
        out += self._J.T @ after
        return 0.5 * float(error @ (after - before))
