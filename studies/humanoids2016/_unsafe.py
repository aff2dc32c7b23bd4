"""Where the published criterion certifies what is unstable: small plants with an exact margin."""

from dataclasses import dataclass

import numpy as np

from sealag.actuation import Actuators
from sealag.margin import DelayedLoop, DelayMargin
from sealag.passivity import Instant, Problem, max_delay, solve
from sealag.typing import Array
from sealag.whole_body import FrozenLoop


@dataclass(frozen=True, slots=True, kw_only=True)
class UnsafeExample:
    """One plant, its two bounds and its exact margin.

    Attributes:
        name: what the plant is and what is fed back.
        published_delay_s: bound of (29) as printed.
        certified_delay_s: bound of the certified criterion; None where it refuses.
        refusal: why the certified criterion refuses, or an empty text.
        margin_s: exact local delay margin.
    """

    name: str
    published_delay_s: float
    certified_delay_s: float | None
    refusal: str
    margin_s: float

    @property
    def published_is_unsafe(self) -> bool:
        """Whether (29) allows a delay at which the loop is unstable."""
        return self.published_delay_s > self.margin_s

    @property
    def certified_is_unsafe(self) -> bool:
        """Whether the certified criterion allows a delay at which the loop is unstable."""
        return self.certified_delay_s is not None and self.certified_delay_s > self.margin_s


def delayed_margin(
    M: Array, K: Array, B_s: Array, *, D: Array, F: Array, link_feedback: bool = False
) -> DelayMargin:
    """Return the exact margin of SEA joints without gravity under delayed stiffness feedback.

    M q̈ = K(θ − q) and B_s θ̈ + D θ̇ + K(θ − q) = −F y(t − d), with y = θ or y = q.

    Args:
        M: (n, n) link inertia.
        K: (n,) spring stiffness.
        B_s: (n,) shaped motor inertia.
        D: (n,) motor damping.
        F: (n, n) delayed stiffness, Nm/rad.
        link_feedback: whether the link angle is fed back instead of the motor angle.
    """
    names = [f"joint{i}" for i in range(len(K))]
    drives = Actuators.of(names, spring_stiffness=K, rotor_inertia=B_s, motor_damping=D)
    none = np.zeros_like(F)
    C_z, C_theta = (-F, none) if link_feedback else (none, -F)
    loop = FrozenLoop.of_links(drives, M=M, H=none, S=np.eye(len(K)), C_z=C_z, C_theta=C_theta)
    return DelayedLoop(loop.A_0, loop.A_1).margin()


def _one_joint(M: float, K_q: float, *, link_feedback: bool = False) -> UnsafeExample:
    K, B_s, D = np.array([350.0]), np.array([0.09]), np.array([10.0])
    published = max_delay(np.eye(1), np.eye(1), np.array([K_q]), D)
    K_theta = np.array([[1.0 / (1.0 / K_q - 1.0 / K[0])]])
    F = np.array([[K_q]]) if link_feedback else K_theta
    margin = delayed_margin(np.array([[M]]), K, B_s, D=D, F=F, link_feedback=link_feedback)
    signal = "link angle" if link_feedback else "q̄(θ)"
    bound = solve(Problem.of_stiffness(K_theta, D), share=Instant())
    certified = None if link_feedback else float(bound.delay)
    return UnsafeExample(
        name=f"one joint, M = {M:g} kg m², K = 350, K_q = {K_q:g} Nm/rad, feedback of {signal}",
        published_delay_s=float(published.delay),
        certified_delay_s=certified,
        refusal="link-angle feedback is not collocated" if link_feedback else "",
        margin_s=margin.delay,
    )


def _asymmetric_plants(count: int, seed: int) -> list[UnsafeExample]:
    """Random 3-joint plants with ΛK_x as printed: those that are unstable without delay."""
    rng = np.random.default_rng(seed)
    found = []
    for index in range(count):
        X = rng.normal(size=(3, 3))
        M = X @ X.T + 0.1 * np.eye(3)
        J = rng.normal(size=(3, 3))
        K_x = 10.0 ** rng.uniform(0.0, 3.0, 3)
        Lambda = np.linalg.inv(J @ np.linalg.solve(M, J.T))
        D, K, B_s = np.full(3, 100.0), np.full(3, 1e4), np.full(3, 0.1)
        published = max_delay(J, Lambda, K_x, D, form="published")
        F = J.T @ Lambda @ np.diag(K_x) @ J
        margin = delayed_margin(M, K, B_s, D=D, F=F)
        if margin.delay < published.delay:
            asymmetry = np.linalg.norm(F - F.T) / np.linalg.norm(F + F.T)
            found.append(
                UnsafeExample(
                    name=f"three joints, ΛK_x as printed, K_x not isotropic (draw {index})",
                    published_delay_s=float(published.delay),
                    certified_delay_s=None,
                    refusal=f"the stiffness is not symmetric (asymmetry {asymmetry:.2f})",
                    margin_s=margin.delay,
                )
            )
    return found


def unsafe_examples(*, draws: int = 200, seed: int = 20161115) -> tuple[UnsafeExample, ...]:
    """Compute the examples of docs/theory section 6 where (29) allows too long a delay.

    Args:
        draws: number of random three-joint plants with the printed stiffness ΛK_x.
        seed: of those plants.

    Returns:
        The one-joint examples (b), then every random plant of kind (a) that (29) gets wrong.
    """
    return (
        _one_joint(1.0, 100.0),
        _one_joint(5.0, 300.0),
        _one_joint(5.0, 100.0, link_feedback=True),
        *_asymmetric_plants(draws, seed),
    )
