"""The compiled operational space against its plain NumPy twin."""

import itertools

import numpy as np
import pytest

from helpers.kernels import from_python, solve_space, space_of
from sealag.kernels import linalg, operational_space
from sealag.kernels.operational_space import FORCE, PUBLISHED, SYMMETRIC

invert_spd, jacobi_eigh = from_python(linalg.invert_spd), from_python(linalg.jacobi_eigh)
pseudo_inverse_psd = from_python(linalg.pseudo_inverse_psd)
invert_low_rank = from_python(linalg.invert_low_rank)
task_torque = from_python(operational_space.task_torque)
TOLERANCE = 1e-10


def plain_space(M, g, J_s, J_t, K_x, *, levels, form, n, star):
    """Eqs. (10), (11) with null-space projectors written out as in the paper."""
    nv = len(M)
    U = np.hstack([np.zeros((n, nv - n)), np.eye(n)])
    Mi = np.linalg.inv(M)

    def pinv(A, scale):
        w, V = np.linalg.eigh(A)
        keep = w > TOLERANCE * np.trace(scale)
        return (V[:, keep] / w[keep]) @ V[:, keep].T

    A_s = J_s @ Mi @ J_s.T
    J_bar = Mi @ J_s.T @ pinv(A_s, A_s)
    N_s = np.eye(nv) - J_bar @ J_s
    UN = U @ N_s
    UN_bar = Mi @ UN.T @ pinv(UN @ Mi @ UN.T, U @ Mi @ U.T)
    N = N_s
    J_star, blocks = [], []
    for first, last in itertools.pairwise(levels):
        J = J_t[first:last] @ N
        Lambda = pinv(J @ Mi @ J.T, J_t[first:last] @ Mi @ J_t[first:last].T)
        J_star.append(J @ UN_bar)
        N = N - Mi @ J.T @ Lambda @ J
        if star:
            unconstrained = J_t[first:last] @ Mi @ J_t[first:last].T
            Lambda = pinv(J_star[-1] @ (UN @ Mi @ UN.T) @ J_star[-1].T, unconstrained)
        K = K_x[first:last, first:last]
        w, V = np.linalg.eigh(Lambda)
        root = V @ np.diag(np.sqrt(np.clip(w, 0, None))) @ V.T
        blocks.append({SYMMETRIC: root @ K @ root, PUBLISHED: Lambda @ K, FORCE: K}[form])
    S = np.zeros_like(K_x)
    for (first, last), block in zip(itertools.pairwise(levels), blocks, strict=True):
        S[first:last, first:last] = block
    return np.vstack(J_star), S, UN_bar, UN_bar.T @ g


CASES = [
    # nv, n, contact rows, levels, copies of contact rows
    (12, 6, 3, [0, 6], 0),
    (12, 6, 3, [0, 3, 6], 0),
    (18, 12, 12, [0, 6, 18], 0),
    (18, 12, 12, [0, 3, 6, 9], 3),
    (7, 7, 0, [0, 6, 13], 0),
    (12, 6, 0, [0, 6], 0),
]


@pytest.mark.parametrize("star", [False, True])
@pytest.mark.parametrize("form", [SYMMETRIC, PUBLISHED, FORCE])
@pytest.mark.parametrize("case", CASES)
def test_matches_projectors_written_out(case, form, star):
    nv, n, c, levels, copies = case
    rng = np.random.default_rng(nv * 100 + c + form)
    X = rng.normal(size=(nv, nv))
    M = X @ X.T + np.eye(nv)
    J_s = rng.normal(size=(c, nv))
    if copies:
        J_s[-copies:] = J_s[:copies]
    m = levels[-1]
    J_t, g = rng.normal(size=(m, nv)), rng.normal(size=nv)
    K_x = np.diag(rng.uniform(1, 100, m))
    space = space_of(nv, n, c, m=m)
    assert solve_space(M, g, J_s, J_t, K_x, np.array(levels), form, star, TOLERANCE, space)
    J_star, S, UN_bar, gravity = plain_space(
        M, g, J_s, J_t, K_x, levels=levels, form=form, n=n, star=star
    )
    np.testing.assert_allclose(space.J_star, J_star, atol=1e-8 * np.abs(J_star).max())
    np.testing.assert_allclose(space.joint_from_base, UN_bar, atol=1e-8 * np.abs(UN_bar).max())
    np.testing.assert_allclose(space.gravity, gravity, atol=1e-8 * np.abs(gravity).max())
    F, F_plain = J_star.T @ S @ J_star, space.J_star.T @ space.stiffness @ space.J_star
    np.testing.assert_allclose(F_plain, F, atol=1e-6 * np.abs(F).max())
    error, out = rng.normal(size=m), np.zeros(n)
    task_torque(space.J_star, space.stiffness, error, space.gravity, out)
    expected = J_star.T @ S @ error + gravity
    np.testing.assert_allclose(out, expected, atol=1e-6 * np.abs(expected).max())


def test_says_no_to_an_indefinite_mass_matrix():
    space = space_of(2, 1, 0, m=1)
    M = np.array([[1.0, 2.0], [2.0, 1.0]])
    args = (np.zeros(2), np.zeros((0, 2)), np.ones((1, 2)), np.eye(1), np.array([0, 1]))
    assert not solve_space(M, *args, SYMMETRIC, False, TOLERANCE, space)


@pytest.mark.parametrize("rank", [0, 1, 4, 6])
def test_pseudo_inverse_and_root(rank):
    rng = np.random.default_rng(rank)
    X = rng.normal(size=(6, rank))
    A = X @ X.T
    out, root = np.zeros((6, 6)), np.zeros((6, 6))
    found = pseudo_inverse_psd(A.copy(), 1e-10, out, root, np.zeros(6), np.zeros((6, 6)))
    assert found == rank
    expected = np.linalg.pinv(A, rcond=1e-10, hermitian=True)
    np.testing.assert_allclose(out, expected, atol=1e-9 * max(1.0, np.abs(expected).max()))
    np.testing.assert_allclose(root @ root, out, atol=1e-9 * max(1.0, np.abs(out).max()))


def test_eigenvectors_of_repeated_eigenvalues():
    rng = np.random.default_rng(5)
    Q, _ = np.linalg.qr(rng.normal(size=(8, 8)))
    A = Q @ np.diag([1.0, 1, 1, 2, 2, 1e-8, 1e6, 1e6]) @ Q.T
    A = (A + A.T) / 2
    values, vectors = np.zeros(8), np.zeros((8, 8))
    jacobi_eigh(A.copy(), values, vectors)
    np.testing.assert_allclose(vectors.T @ vectors, np.eye(8), atol=1e-13)
    np.testing.assert_allclose(vectors @ np.diag(values) @ vectors.T, A, atol=1e-8)


def test_cholesky_inverse_and_its_refusal():
    rng = np.random.default_rng(6)
    X = rng.normal(size=(5, 5))
    A, out = X @ X.T + np.eye(5), np.zeros((5, 5))
    assert invert_spd(A, out, np.zeros((5, 5)))
    np.testing.assert_allclose(out @ A, np.eye(5), atol=1e-12)
    assert not invert_spd(-A, out, np.zeros((5, 5)))


def low_rank_scratch(n):
    return np.zeros((n, n)), np.zeros((5, n * n)), np.zeros(n)


@pytest.mark.parametrize("noise", [0.0, 1e-15, 1e-12])
@pytest.mark.parametrize("rank", [0, 1, 4, 6, 9])
def test_low_rank_inverse_without_eigenvalues_is_theirs_or_says_that_it_is_not(rank, noise):
    rng = np.random.default_rng(rank)
    Q = np.linalg.qr(rng.normal(size=(9, 9)))[0][:, :rank]
    A = Q @ np.diag(np.geomspace(1.0, 100.0, rank)) @ Q.T
    E = rng.normal(size=(9, 9))
    noisy = A + noise * np.abs(A).max(initial=1.0) * (E + E.T)
    out, scratch, values = low_rank_scratch(9)
    kept = noisy.copy()
    found = invert_low_rank(noisy, 1e-9 * max(1.0, np.trace(A)), out, scratch, values)
    np.testing.assert_array_equal(noisy, kept)
    assert found in (rank, -1)
    if found >= 0:
        expected = np.linalg.pinv(A, rcond=1e-8, hermitian=True)
        np.testing.assert_allclose(out, expected, atol=1e-8)
    assert found == rank or noise == 1e-12 or rank == 0


@pytest.mark.parametrize("smallest", [1e-2, 1e-7, 3e-9, 3e-10, 1e-12])
def test_low_rank_inverse_leaves_doubtful_ranks_to_eigenvalues(smallest):
    """An eigenvalue near the threshold, on either side of it, is not for a factorisation."""
    rng = np.random.default_rng(3)
    Q = np.linalg.qr(rng.normal(size=(6, 6)))[0]
    A = Q @ np.diag([1.0, 2.0, 3.0, 4.0, smallest, 0.0]) @ Q.T
    out, scratch, values = low_rank_scratch(6)
    found = invert_low_rank(A, 1e-9, out, scratch, values)
    assert found == (5 if smallest == 1e-2 else -1)


def test_noise_in_a_lost_direction_falls_back_on_eigenvalues():
    """Contacts written three times leave rounding that a factorisation would take for motion."""
    rng = np.random.default_rng(11)
    nv, n = 18, 12
    X = rng.normal(size=(nv, nv))
    M = X @ X.T + np.eye(nv)
    once = rng.normal(size=(12, nv))
    J_s = np.vstack([once, once + 1e-13 * rng.normal(size=once.shape), once])
    J_t, g, K_x = rng.normal(size=(6, nv)), rng.normal(size=nv), np.eye(6)
    space = space_of(nv, n, len(J_s), m=6)
    levels = np.array([0, 6])
    assert solve_space(M, g, J_s, J_t, K_x, levels, FORCE, False, TOLERANCE, space)
    J_star, _, UN_bar, gravity = plain_space(
        M, g, J_s, J_t, K_x, levels=[0, 6], form=FORCE, n=n, star=False
    )
    np.testing.assert_allclose(space.J_star, J_star, atol=1e-8 * np.abs(J_star).max())
    np.testing.assert_allclose(space.joint_from_base, UN_bar, atol=1e-8 * np.abs(UN_bar).max())
    np.testing.assert_allclose(space.gravity, gravity, atol=1e-8 * np.abs(gravity).max())
