"""The compiled bracket against a slow twin: dense grid of angles, then golden section."""

import numpy as np
import pytest

from helpers.kernels import from_python
from sealag.kernels import numerical_radius
from sealag.kernels.numerical_radius import numerical_radii

support = from_python(numerical_radius.support)


def support_twin(A, phi):
    H = np.cos(phi) * (A + A.T) / 2 + 0.5j * np.sin(phi) * (A - A.T)
    return np.linalg.eigvalsh(H)[-1]


def radius_twin(A):
    """w(A): 721 angles on [0, π], golden section around the best three."""
    angles = np.linspace(0.0, np.pi, 721)
    values = np.array([support_twin(A, phi) for phi in angles])
    best = values.max()
    ratio = (np.sqrt(5.0) - 1.0) / 2.0
    for k in np.argsort(values)[-3:]:
        low, high = angles[max(k - 1, 0)], angles[min(k + 1, 720)]
        while high - low > 1e-9:
            a, b = high - ratio * (high - low), low + ratio * (high - low)
            if support_twin(A, a) > support_twin(A, b):
                high = b
            else:
                low = a
        best = max(best, support_twin(A, (low + high) / 2.0))
    return best


def corpus():
    rng = np.random.default_rng(5)
    for n in (1, 2, 3, 5, 8):
        A = rng.normal(size=(n, n))
        Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
        u = rng.normal(size=n)
        yield f"random {n}", A
        yield f"symmetric {n}", A + A.T
        yield f"skew {n}", A - A.T
        yield f"orthogonal {n}", Q
        yield f"nilpotent {n}", np.triu(A, 1)
        yield f"shift {n}", np.eye(n, k=1)
        yield f"identity {n}", 2.0 * np.eye(n)
        yield f"rank one {n}", np.outer(u, u)
        yield f"spread {n}", np.diag(10.0 ** np.linspace(-4, 4, n)) @ A
        yield f"nearly repeated {n}", Q @ np.diag(1.0 + 1e-13 * np.arange(n)) @ Q.T
        yield f"negative {n}", -Q @ np.diag(np.arange(1.0, n + 1)) @ Q.T
        yield f"tiny {n}", 1e-140 * A
        yield f"huge {n}", 1e140 * A


def bracket(A, slack=0.0, tolerance=5e-7):
    lower, upper, angle = np.zeros(1), np.zeros(1), np.zeros(1)
    numerical_radii(
        np.ascontiguousarray(A)[None], np.array([slack]), tolerance, lower, upper, angle
    )
    return lower[0], upper[0], angle[0]


@pytest.mark.parametrize(("name", "A"), list(corpus()), ids=lambda value: str(value)[:20])
def test_bracket_holds_the_twin_and_is_narrow(name, A):
    unit = np.abs(A).max() or 1.0
    expected = unit * radius_twin(A / unit)
    lower, upper, angle = bracket(A)
    assert lower <= expected * (1.0 + 1e-13)
    assert upper >= expected * (1.0 - 1e-13)
    assert upper - lower <= 6e-7 * upper
    if expected > 0.0:
        assert support_twin(A / unit, angle) * unit == pytest.approx(expected, rel=1e-6)


def test_uncertainty_widens_both_ends():
    A = np.array([[2.0, 1.0], [0.0, 1.0]])
    lower, upper, _ = bracket(A)
    wide_lower, wide_upper, _ = bracket(A, slack=0.1)
    assert wide_lower == pytest.approx(lower - 0.1)
    assert wide_upper == pytest.approx(upper + 0.1)


def test_support_agrees_at_every_angle():
    rng = np.random.default_rng(2)
    for n in (1, 2, 3, 6, 12):
        A = rng.normal(size=(n, n))
        scale = np.linalg.norm(A)
        for phi in np.linspace(0.0, np.pi, 9):
            value = support(
                (A + A.T) / 2,
                (A - A.T) / 2,
                phi,
                np.empty((n, n), complex),
                np.empty(n, complex),
                np.empty(n, complex),
                np.empty(n),
                np.empty(max(n - 1, 1)),
                scale,
            )
            assert value == pytest.approx(support_twin(A, phi), abs=1e-14 * n * scale)


def test_the_shortcut_at_angle_zero_would_have_been_seen():
    c, s = np.cos(1.2), np.sin(1.2)
    A = np.array([[c, -s], [s, c]])
    assert np.linalg.eigvalsh((A + A.T) / 2)[-1] < 0.4 * bracket(A)[0]
