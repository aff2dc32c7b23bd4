"""Random series elastic plants on which certificates and exact margins are compared."""

from dataclasses import dataclass

import numpy as np

from sealag.actuation import Actuators
from sealag.errors import InputError
from sealag.typing import Array
from sealag.whole_body import FrozenLoop, GravityCompensation, Signal, StiffnessForm

_SYMMETRIC = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SeaPlant:
    """A frozen series elastic plant with a delayed task law; no base, no contacts.

    M q̈ + G q + K (q − θ) = 0 and B_s θ̈ + D_θ θ̇ + K (θ − q) = −F y(t − d), with y = q for link
    feedback and y = θ otherwise; the state is [q, θ, q̇, θ̇]. With the energy tank, x̂ moves with J θ̇
    while it is empty: what it pays for is no part of the frozen loop.

    Attributes:
        M: (n, n) link inertia, kg m².
        G: (n, n) gravity Hessian of the links, symmetric, Nm/rad.
        K: (n,) spring stiffness, Nm/rad.
        B_s: (n,) shaped motor inertia, kg m².
        D_theta: (n,) motor damping, Nms/rad.
        J: (m, n) task Jacobian.
        Lambda: (m, m) task inertia (J M⁻¹ Jᵀ)⁺.
        K_x: (m,) task gains, 1/s², or N/m for the form `force`.
        form: stiffness form of docs/theory section 6.
        signal: what is fed back.
        gravity: `feedback` (G delayed with the rest), `planned` or `none` (no gradient).
        F: (n, n) whole delayed stiffness −∂τ_osc/∂y, Nm/rad.
        contraction: spectral radius of K⁻¹ F_q, the factor of the static joint state q̄.
        A_0: (4n, 4n) undelayed part of the loop.
        A_1: (4n, 4n) delayed part.
        symmetries: (4n, s) neutral directions: joint motions that neither task nor gravity feel.
    """

    M: Array
    G: Array
    K: Array
    B_s: Array
    D_theta: Array
    J: Array
    Lambda: Array
    K_x: Array
    form: StiffnessForm
    signal: Signal
    gravity: GravityCompensation
    F: Array
    contraction: float
    A_0: Array
    A_1: Array
    symmetries: Array

    @property
    def certifiable(self) -> bool:
        """Whether the certified criterion may speak: collocated, contracting, symmetric PSD F."""
        if not self.signal.has_potential or self.signal.refusal(np.array([self.contraction])):
            return False
        size = np.abs(self.F).max()
        if np.abs(self.F - self.F.T).max() > _SYMMETRIC * size:
            return False
        return bool(np.linalg.eigvalsh(self.F + self.F.T)[0] >= -_SYMMETRIC * size)

    @property
    def presupposed(self) -> bool:
        """Whether the paper's law can be run on it: ΛK_x, motor angles or a q̄(θ) that exists."""
        exists = not self.signal.refusal(np.array([self.contraction]))
        return self.form is StiffnessForm.PUBLISHED and self.signal.has_potential and exists

    @property
    def stable(self) -> bool:
        """Whether the potential's Hessian over [q, θ] is positive definite up to symmetries."""
        K, n = np.diag(self.K), len(self.K)
        hessian = np.block([[self.G + K, -K], [-K, K + (self.F + self.F.T) / 2.0]])
        directions = self.symmetries[: 2 * n]
        rest = np.linalg.svd(directions, full_matrices=True)[0][:, directions.shape[1] :]
        values = np.linalg.eigvalsh(rest.T @ hessian @ rest)
        return bool(len(values) and values[0] > 1e-9 * values[-1])


def random_sea_plant(
    seed: int,
    *,
    joints: int | None = None,
    form: StiffnessForm | str | None = None,
    signal: Signal | str | None = None,
) -> SeaPlant:
    """Draw one plant: 1–6 joints, soft to stiff springs, with and without gravity.

    M = X Xᵀ + 0.1 I with normal X; J is square or has fewer or more rows than joints; gains
    spread over three decades; the rest log-uniform. The same seed gives the same plant.

    Args:
        seed: of the generator.
        joints: number of joints, or None to draw it.
        form: stiffness form, or None to draw it.
        signal: what is fed back, or its word, or None to draw it.

    Returns:
        The plant with its frozen loop.

    Raises:
        InputError: fewer than one joint, or an unknown form or signal.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 7))
    drawn_form = StiffnessForm(rng.choice(list(StiffnessForm)))
    drawn_signal = Signal.names()[rng.integers(len(Signal.names()))]
    if joints is not None:
        n = joints
    if n < 1:
        raise InputError(f"joints is {n}; a plant has at least one.")
    try:
        kind = drawn_form if form is None else StiffnessForm(form)
    except ValueError as problem:
        raise InputError(f"{problem}.") from None
    chosen = drawn_signal if signal is None else signal
    return _plant(
        rng, n, kind=kind, signal=Signal.named(chosen) if isinstance(chosen, str) else chosen
    )


def _plant(rng: np.random.Generator, n: int, *, kind: StiffnessForm, signal: Signal) -> SeaPlant:
    X = rng.normal(size=(n, n))
    M = X @ X.T + 0.1 * np.eye(n)
    m = n if rng.random() < 0.6 else int(rng.integers(1, n + 3))
    J = rng.normal(size=(m, n))
    Lambda = np.linalg.pinv(J @ np.linalg.solve(M, J.T), rcond=1e-11, hermitian=True)
    K_x = 10.0 ** rng.uniform(0.0, 3.0, m)
    K = 10.0 ** rng.uniform(rng.uniform(1.5, 4.0), 5.0, n)
    B_s, D = 10.0 ** rng.uniform(-2.0, 0.0, n), 10.0 ** rng.uniform(0.0, 2.3, n)
    weight = rng.choice([0.0, 10.0 ** rng.uniform(-1.0, 2.0)])
    Y = rng.normal(size=(n, n))
    G = weight * (Y + Y.T) / 2.0
    gravity = GravityCompensation(rng.choice(list(GravityCompensation)))
    F_q = J.T @ _task_stiffness(kind, Lambda, K_x) @ J
    if gravity is GravityCompensation.FEEDBACK:
        F_q = F_q - G
    F = signal.motor_stiffness(F_q, K)
    if kind is not StiffnessForm.PUBLISHED:
        F = (F + F.T) / 2.0
    drives = Actuators.of(
        [f"joint{i}" for i in range(n)], spring_stiffness=K, rotor_inertia=B_s, motor_damping=D
    )
    loop = _frozen_loop(M, G, drives, F=F, links=not signal.has_potential)
    free = np.linalg.svd(J, full_matrices=True)[2][m:].T if weight == 0.0 else np.zeros((n, 0))
    return SeaPlant(
        M=M, G=G, K=K, B_s=B_s, D_theta=D, J=J, Lambda=Lambda, K_x=K_x,
        form=kind, signal=signal, gravity=gravity, F=F,
        contraction=float(np.abs(np.linalg.eigvals(F_q / K[:, None])).max()),
        A_0=loop.A_0, A_1=loop.A_1,
        symmetries=np.vstack([free, free, np.zeros((2 * n, free.shape[1]))]),
    )  # fmt: skip


def _task_stiffness(kind: StiffnessForm, Lambda: Array, K_x: Array) -> Array:
    if kind is StiffnessForm.FORCE:
        return np.diag(K_x)
    if kind is StiffnessForm.PUBLISHED:
        return Lambda @ np.diag(K_x)
    values, vectors = np.linalg.eigh(Lambda)
    root = (vectors * np.sqrt(np.maximum(values, 0.0))) @ vectors.T
    return root @ np.diag(K_x) @ root


def _frozen_loop(M: Array, G: Array, drives: Actuators, *, F: Array, links: bool) -> FrozenLoop:
    none = np.zeros_like(F)
    C_z, C_theta = (-F, none) if links else (none, -F)
    return FrozenLoop.of_links(drives, M=M, H=G, S=np.eye(len(F)), C_z=C_z, C_theta=C_theta)
