"""The stiffness with the least quadratic index within a delay (docs/theory section 16.7)."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sealag.design import System
from sealag.errors import InputError, SolverError
from sealag.tune._answer import Tuned
from sealag.tune._findings import Index
from sealag.tune._passive import EASE, Knobs
from sealag.tune._question import Limit, Question
from sealag.typing import Array
from sealag.whole_body import StaticJoint

_GAP = 1e-9
"""Largest share of the index by which it may lie above its minimum. Ten times more is seen in the
fourth digit of a gain, of which the index is a parabola; ten times less is rounding."""
_STEPS = 200
"""Newton steps of one barrier; examples need 3 to 20."""
_NOTHING = 1e-9
"""Share of the largest stiffness below which a group moves nothing, as a posture under tasks that
hold all of it."""
_RANK = 1e-10
"""Share of the largest eigenvalue below which a stiffness has no direction: J* drops what is small
long before."""


class _Slope(NamedTuple):
    """A function of the factors with its derivatives."""

    value: float
    gradient: Array
    Hessian: Array


def optimal(question: Question) -> Tuned:
    """Return the design with the least index, in few digits, certified.

    Where damping rules the motors, D θ̇ = τ = −F_θ θ̃, the index ∫ (|x̃|²/e² + |τ|²/t²) ds of errors
    that start with θ̃ᵀD θ̃ alike in all directions is ½ tr(Q F_θ⁺) + ½ tr(R F_θ), Q = J*ᵀJ*/e²,
    R = I/t²: convex in F_θ ≽ 0, and, with F_θ of its signal, in the factors of F_q.

    Args:
        question: its design, motion and weights.

    Raises:
        InputError: a task's stiffness is not its own (plain task errors), so that no index exists.
        SolverError: the minimum was not found.
    """
    index = _Quadratic(question)
    if index.knobs.limits(question.required).whitened() is None:
        return Tuned.none(question, "gravity compensation alone is stiffer than the delay allows")
    free = index.least(None)
    at_limit = _within(index, free, question.required)
    eased = _within(index, free, question.required * (1.0 + EASE))
    active = not np.array_equal(at_limit, free)
    found = Index(
        value=index.value(at_limit),
        free=index.value(free),
        least=index.riccati(),
        active=active,
    )
    knobs = index.knobs
    tuned = Tuned.of(
        question,
        knobs.design(eased),
        kind="delay" if active else "index",
        spring_share=knobs.limits(question.required).wall(at_limit).spring if active else 0.0,
        factors={group.name: float(gain) for group, gain in zip(knobs.groups, eased)},
        limit=found.value,
        index=found,
    )
    return tuned


def _within(index: "_Quadratic", free: Array, delay: float) -> Array:
    """The factors with the least index that a delay allows; `free` itself where it is allowed."""
    if index.knobs.limits(delay).wall(free).scale >= 1.0:
        return free
    return index.least(delay)


class _Quadratic:
    """½ mean_t [tr(Q F_θ⁺) + tr(R F_θ)] as a function of the factors of a design's stiffness."""

    def __init__(self, question: Question) -> None:
        """Evaluate the law along the motion."""
        self.knobs = Knobs(question)
        system: System = question.system
        error, torque = question.limits[Limit.ERROR], question.limits[Limit.TORQUE]
        size = np.abs(self.knobs.parts).max(axis=(1, 2, 3))
        self._moving = size > _NOTHING * size.max()
        self._parts = self.knobs.parts[self._moving]  # (G, N, n, n)
        J = system.spaces(question.motion).J_star
        self._error = J / error  # (N, m, n)
        self._Q = self._error.transpose(0, 2, 1) @ self._error
        self._R = 1.0 / torque**2
        self._D = system.actuators.motor_damping
        self._K = system.actuators.spring_stiffness
        # x̃(q̄(θ)) is stiffer than x̃(θ) by the springs: F_θ = K^½ ((I − K^-½ F K^-½)⁻¹ − I) K^½.
        self._stiffer = isinstance(system.law.signal, StaticJoint)
        full = self._parts.sum(axis=0)
        values, vectors = np.linalg.eigh(full)
        lost = vectors * (values <= _RANK * values[:, -1:])[:, None]
        unseen = np.abs(np.einsum("tij,tjk->tik", self._Q, lost)).max()
        if unseen > 1e-6 * np.abs(self._Q).max():
            raise InputError(
                "Errors of a task move joints that no stiffness of it moves; the index has no "
                'least value. Give each row of the tasks a gain, or task_error = "consistent".'
            )

    def value(self, factors: Array) -> float:
        """Return the index, s.

        Args:
            factors: (G,) of the groups.
        """
        return float(self._index(factors[self._moving]).value)

    def riccati(self) -> float:
        """Return the least index of any linear controller of the motors' angles without delay, s.

        tr(D⁻¹ P), P D⁻¹R⁻¹D⁻¹ P = Q: P = D (D⁻¹QD⁻¹)^½ D √R.
        """
        _, sizes, rows = np.linalg.svd(self._error / self._D, full_matrices=False)
        weight = rows**2 @ self._D
        return float(np.sqrt(self._R) * (sizes * weight).sum(axis=1).mean())

    def least(self, delay: float | None) -> Array:
        """Return the factors with the least index within a delay's limits, 1 for groups that move
        nothing.

        Args:
            delay: s; None for none, where only a spring's own limit is left.

        Raises:
            SolverError: Newton's method did not end.
        """
        tiny = 1e-9  # s: D/d is far stiffer than anything else then
        limits = self.knobs.limits(tiny if delay is None else delay)
        A = limits.whitened()
        assert A is not None  # `optimal` has asked
        A = A[self._moving]
        start = limits.wall(self._moving.astype(float))
        factors = np.full(len(self._parts), 0.5 * min(start.scale, 1e12))
        eye = np.broadcast_to(np.eye(A.shape[-1]), A.shape[1:])
        count = float(A.shape[1] * A.shape[2] + len(factors))
        barrier = self._index(factors).value / count

        def value(f: Array) -> _Slope | None:
            if (f <= 0.0).any():
                return None
            room = _log_det(A, eye, f)
            return None if room is None else _sum(self._index(f), barrier, room, f)

        while True:
            factors = _newton(value, factors)
            now = self._index(factors).value
            if barrier * count <= _GAP * now:
                all_factors = np.ones(len(self._moving))
                all_factors[self._moving] = factors
                return all_factors
            barrier = max(barrier * 0.1, 0.99 * _GAP * now / count)

    def _index(self, f: Array) -> _Slope:
        """The index with its derivatives; infinite beyond the springs."""
        count = self._Q.shape[0]
        F = np.tensordot(f, self._parts, axes=1)
        error = _trace_of_inverse(self._Q, F, self._parts)
        if not self._stiffer:
            size = np.einsum("gtii->g", self._parts) * self._R
            torque = _Slope(float(f @ size), size, np.zeros((len(f), len(f))))
        else:
            root = np.sqrt(self._K)
            scaled = self._parts / np.multiply.outer(root, root)
            left = np.eye(len(root)) - np.tensordot(f, scaled, axes=1)
            weight = np.broadcast_to(np.diag(self._K * self._R), left.shape)
            inverse = _trace_of_inverse(weight, left, -scaled)
            # tr(Q F_θ⁺) = tr(Q F⁺) − tr(Q K⁻¹)
            held = np.einsum("tii,i->", self._Q, 1.0 / self._K)
            torque = inverse._replace(
                value=inverse.value - count * self._R * self._K.sum() - float(held)
            )
        half = 0.5 / count
        return _Slope(*(half * (a + b) for a, b in zip(error, torque)))


def _trace_of_inverse(W: Array, X: Array, parts: Array) -> _Slope:
    """Σ_t tr(W X⁺) for X = X_0 + Σ f_g P_g (N, n, n), all of one range."""
    values, vectors = np.linalg.eigh(X)
    kept = values > _RANK * values[:, -1:]
    root = np.where(kept, 1.0 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
    half = vectors * root[:, None]
    w = half.transpose(0, 2, 1) @ W @ half
    C = half.transpose(0, 2, 1) @ parts @ half
    wC = w @ C
    return _Slope(
        float(np.einsum("tii->", w)),
        -np.einsum("gtii->g", wC),
        2.0 * np.einsum("gtij,htji->gh", wC, C),
    )


def _log_det(A: Array, eye: Array, f: Array) -> _Slope | None:
    """−Σ_t log det(I − Σ f_g A_g); None outside."""
    values, vectors = np.linalg.eigh(eye - np.tensordot(f, A, axes=1))
    if values[:, 0].min() <= 0.0:
        return None
    half = vectors / np.sqrt(values)[:, None]
    B = half.transpose(0, 2, 1) @ A @ half
    return _Slope(
        -float(np.log(values).sum()),
        np.einsum("gtii->g", B),
        np.einsum("gtij,htij->gh", B, B),
    )


def _sum(index: _Slope, barrier: float, room: _Slope, f: Array) -> _Slope:
    """index + barrier · (room − Σ log f)."""
    return _Slope(
        index.value + barrier * (room.value - float(np.log(f).sum())),
        index.gradient + barrier * (room.gradient - 1.0 / f),
        index.Hessian + barrier * (room.Hessian + np.diag(1.0 / f**2)),
    )


def _newton(function: Callable[[Array], _Slope | None], start: Array) -> Array:
    """The minimum of a convex function by damped Newton steps in units of the start."""
    x = start
    at = function(x)
    assert at is not None
    for _ in range(_STEPS):
        unit = np.multiply.outer(x, x)
        step = -x * np.linalg.lstsq(at.Hessian * unit, at.gradient * x, rcond=None)[0]
        gain = -float(at.gradient @ step)
        if gain <= 1e-14 * abs(at.value):
            return x
        share = 1.0
        while share > 1e-10:
            tried = function(x + share * step)
            if tried is not None and tried.value <= at.value - 0.1 * share * gain:
                break
            share *= 0.5
        else:
            return x  # rounding decides
        x, at = x + share * step, tried
    raise SolverError("the least quadratic index was not found; take fewer directions (--share)")
