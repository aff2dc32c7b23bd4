"""Linear controllers with memory: what they do from tick to tick, and as part of a frozen loop."""

from dataclasses import dataclass, replace

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError
from sealag.typing import Array
from sealag.whole_body._signal_states import LawDerivative

_RANKS = 10.0 ** -np.arange(3, 10)
"""Shares of the largest singular value of a Hankel matrix from which it counts as memory: the first
that explains the answers. Central differences leave 1e-10 of it; from there states are noise."""

_EXPLAINED = 1e-6
"""Share of the answers that fewer states may leave open. Differences leave 1e-8; ten times more
leaves out the weaker of two filters."""

_SILENT = 1e-5
"""Share of the largest answer that counts as next to nothing. Rates are fed back with a thousandth
of the gain of angles; ten times less is near what differences leave."""

_WINDOW = 40
"""Ticks in one side of a Hankel matrix, at most: as many states can be told apart per command. What
comes later must agree, and is part of what is left unexplained."""

_NYQUIST = 1e-9
"""Distance of an eigenvalue of A from −1, where the bilinear equivalent ends. Ten times smaller
leaves it six digits; ten times larger refuses filters that nobody builds."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LinearLaw:
    """ξ̇ = A ξ + B y, or ξ_{k+1} = A ξ_k + B y_k of a period, with δτ_osc = C ξ + D y.

    y = (δq, δv, δθ, δθ̇, δτ_sea), along tangent motions, m = 2 nv + 3 n.

    Attributes:
        A: (s, s); s = 0 without memory.
        B: (s, m).
        C: (n, s).
        D: (n, m).
        period: T, s; 0 for matrices in continuous time.
    """

    A: Array
    B: Array
    C: Array
    D: Array
    period: float = 0.0

    @classmethod
    def static(cls, D: Array) -> "LinearLaw":
        """Return a law without memory.

        Args:
            D: (n, m).
        """
        n, m = D.shape
        return cls(A=np.zeros((0, 0)), B=np.zeros((0, m)), C=np.zeros((n, 0)), D=D)

    @classmethod
    def realised(cls, steps: Array, *, period: float) -> tuple["LinearLaw", float]:
        """Return the law with fewest states that answers steps as given, and what it leaves.

        The impulse answers are h_0 = D and h_k = C A^{k−1} B, so that H = [h_{i+j−1}] is the
        product of [C A^{i−1}] and [A^{j−1} B], each half of its singular value decomposition, and
        the same a tick later is the product around A (Ho and Kalman, 1966).

        Args:
            steps: (N, n, m) commands from the first tick after a unit step until they stay.
            period: T, s.

        Returns:
            The law, and the largest difference of its answers from these, as a share of what the
            same measured quantity does; of one that does next to nothing, as a share of that.
        """
        impulses = np.diff(steps, axis=0)
        w = min(_WINDOW, len(impulses) // 2 + 1)
        impulses = np.concatenate([impulses, np.zeros((2 * w, *impulses.shape[1:]))])

        def hankel(first: int) -> Array:
            rows = [np.hstack(list(impulses[first + i : first + i + w])) for i in range(w)]
            return np.vstack(rows)

        now, later = hankel(0), hankel(1)
        U, values, V = np.linalg.svd(now, full_matrices=False)
        best: tuple[LinearLaw, float] | None = None
        for share in _RANKS:
            order = int((values > share * values[0]).sum())
            if best is not None and order == len(best[0].A):
                continue
            law = cls._of_hankel(U[:, :order], values[:order], V[:order], later, steps, period)
            left = law._left_by(steps)
            if best is None or left < best[1]:
                best = law, left
            if left < _EXPLAINED:
                break
        assert best is not None
        return best

    @classmethod
    def _of_hankel(
        cls, U: Array, values: Array, V: Array, later: Array, steps: Array, period: float
    ) -> "LinearLaw":
        """Split a Hankel matrix U diag(values) V in the middle, and take A from the next one."""
        n, m = steps.shape[1:]
        root = np.sqrt(values)
        A = (U / root).T @ later @ (V / root[:, None]).T
        B, C = (root[:, None] * V)[:, :m], (U * root)[:n]
        return cls(A=A, B=B, C=C, D=steps[0], period=period)

    def _left_by(self, steps: Array) -> float:
        """Largest difference of the answers to steps from these, as `realised` counts it."""
        left = np.abs(self._answered(len(steps)) - steps).max(axis=(0, 1))
        size = np.abs(steps).max(axis=(0, 1))
        share = float((left / np.maximum(size, _SILENT * size.max())).max())
        return share if np.isfinite(share) else np.inf

    def _answered(self, count: int) -> Array:
        """Commands (count, n, m) at the ticks after a unit step."""
        state, found = np.zeros_like(self.B), []
        for _ in range(count):
            found.append(self.C @ state + self.D)
            state = self.A @ state + self.B
        return np.array(found)

    def of_springs(self, actuators: Actuators) -> "LinearLaw":
        """Return it with δτ_sea = K (δθ − δq_j) + D_s (δθ̇ − δq̇_j) put in, its columns left out.

        Args:
            actuators: the springs.
        """
        n = len(self.D)
        nv = (self.D.shape[1] - 3 * n) // 2

        def put(columns: Array) -> Array:
            q, v, theta, theta_dot, torque = np.split(columns, np.cumsum([nv, nv, n, n]), axis=1)
            q, v = q.copy(), v.copy()
            q[:, nv - n :] -= torque * actuators.spring_stiffness
            v[:, nv - n :] -= torque * actuators.spring_damping
            theta = theta + torque * actuators.spring_stiffness
            theta_dot = theta_dot + torque * actuators.spring_damping
            return np.hstack([q, v, theta, theta_dot, np.zeros_like(torque)])

        return replace(self, B=put(self.B), D=put(self.D))

    def derivative(self) -> LawDerivative:
        """Return it in continuous time, without columns of δτ_sea.

        z = (1 + sT/2) / (1 − sT/2) makes of matrices of a period T

            A_c = (2/T) (A − 1) (A + 1)⁻¹ ,    B_c = (A + 1)⁻¹ B ,
            C_c = (4/T) C (A + 1)⁻¹ ,          D_c = D − C B_c ,

        with the same answer at rest, and at other frequencies that of ω' = (2/T) tan(ωT/2).

        Raises:
            InputError: an eigenvalue of A is −1: it has no such equivalent.
        """
        A, B, C, D = self.A, self.B, self.C, self.D
        if self.period and len(A):
            one = np.eye(len(A))
            if np.abs(np.linalg.eigvals(A) + 1.0).min() < _NYQUIST:
                raise InputError(
                    "The controller's matrix A has an eigenvalue at -1: it answers with a motion "
                    "that changes sign every tick, which no continuous loop has."
                )
            back = np.linalg.inv(A + one)
            A = (2.0 / self.period) * (A - one) @ back
            B = back @ B
            D = D - C @ B
            C = (4.0 / self.period) * C @ back
        n = len(D)
        nv = (D.shape[1] - 3 * n) // 2
        cuts = np.cumsum([nv, nv, n, n])
        B_q, B_v, B_theta, B_rate, _ = np.split(B, cuts, axis=1)
        C_q, C_v, C_theta, C_rate, _ = np.split(D, cuts, axis=1)
        return LawDerivative(
            A=A, B_q=B_q, B_theta=B_theta, B_v=B_v, B_rate=B_rate, C=C, C_q=C_q, C_theta=C_theta,
            C_v=C_v, C_rate=C_rate, period=self.period if len(A) else 0.0, held=True,
        )  # fmt: skip
