"""Laws that every bound obeys: scalings, bases, and the worst direction's power balance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.levels import instant_bound
from sealag.passivity import max_delay


@st.composite
def problems(draw):
    seed = draw(st.integers(0, 2**32 - 1))
    n, m = draw(st.integers(1, 6)), draw(st.integers(1, 6))
    rank = draw(st.integers(1, min(m, n)))
    spread = draw(st.floats(0.0, 4.0))
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(m, rank)) @ rng.normal(size=(rank, n))
    X = rng.normal(size=(m, draw(st.integers(1, m))))
    return J, X @ X.T, 10.0 ** rng.uniform(0, spread, m), rng.uniform(0.5, 50.0, n)


FORMS = st.sampled_from(["symmetric", "published", "force"])


@settings(max_examples=60, deadline=None, derandomize=True)
@given(problem=problems(), form=FORMS, factor=st.floats(1e-3, 1e3))
def test_proportional_to_damping_and_to_one_over_stiffness(problem, form, factor):
    J, Lambda, K_x, D = problem
    one = max_delay(J, Lambda, K_x, D, form=form)
    damped = max_delay(J, Lambda, K_x, factor * D, form=form)
    stiffer = max_delay(J, Lambda, factor * K_x, D, form=form)
    assert damped.delay <= factor * one.upper * (1 + 1e-12)
    assert damped.upper >= factor * one.delay * (1 - 1e-12)
    assert stiffer.delay <= one.upper / factor * (1 + 1e-12)
    assert stiffer.upper >= one.delay / factor * (1 - 1e-12)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(problem=problems(), form=FORMS, seed=st.integers(0, 2**31))
def test_no_motion_beats_the_bound(problem, form, seed):
    """|zᴴ A z| ≤ 1/d for unit z: each z gives an upper bound of the delay."""
    J, Lambda, K_x, D = problem
    bound = max_delay(J, Lambda, K_x, D, form=form)
    if np.isinf(bound.delay):
        return
    rng = np.random.default_rng(seed)
    n = len(D)
    Z = rng.normal(size=(200, n)) + 1j * rng.normal(size=(200, n))
    Z /= np.linalg.norm(Z, axis=1)[:, None]
    values = np.abs(np.einsum("ki,ij,kj->k", Z.conj(), bound.problem.scaled_stiffness(), Z))
    assert values.max() <= (1 + 1e-12) / bound.delay
    phi, A = float(bound.angle), bound.problem.scaled_stiffness()
    H = np.cos(phi) * (A + A.T) / 2 + 0.5j * np.sin(phi) * (A - A.T)
    z = np.linalg.eigh(H)[1][:, -1]
    reached = abs(z.conj() @ A @ z)
    assert reached == pytest.approx(
        1 / bound.upper, rel=2e-6, abs=2 * (1 / bound.delay - 1 / bound.upper)
    )
    np.testing.assert_allclose(bound.direction, np.abs(z) ** 2, atol=1e-6)


@settings(max_examples=40, deadline=None, derandomize=True)
@given(problem=problems(), seed=st.integers(0, 2**31))
def test_the_order_and_basis_of_tasks_do_not_matter(problem, seed):
    J, Lambda, _, D = problem
    Q = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(J), len(J))))[0]
    one = max_delay(J, Lambda, np.full(len(J), 7.0), D)
    turned = Q @ Lambda @ Q.T
    other = max_delay(Q @ J, (turned + turned.T) / 2, np.full(len(J), 7.0), D)
    scale = 1 + 1e-9 * np.linalg.norm(J) ** 2 * np.linalg.norm(Lambda) * 7 * one.upper
    assert other.delay <= one.upper * scale
    assert other.upper >= one.delay / scale


@settings(max_examples=40, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**31), n=st.integers(2, 5), log=st.floats(-6.0, 6.0))
def test_batch_and_units_agree_for_asymmetric_stiffness(seed, n, log):
    rng = np.random.default_rng(seed)
    F, D = rng.normal(size=(3, n, n)), rng.uniform(1, 10, n)
    unit = 10.0**log
    together = instant_bound(unit * F, D)
    for k in range(3):
        alone = instant_bound(F[k], D)
        assert together.delay[k] * unit <= alone.upper * (1 + 1e-12)
        assert together.upper[k] * unit >= alone.delay * (1 - 1e-12)
    assert (together.width <= 1e-6).all()
