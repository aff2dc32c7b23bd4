"""Certificates a second, beside the paper's way and one direct SDP."""

import statistics
import time
import warnings
from collections.abc import Callable
from functools import partial

import cvxpy as cp
import numpy as np

import sealag
from sealag.passivity import ClarabelDirect, Motion, Problem, max_delay, solve
from sealag.walking import GroundProfile, WalkPlan

SIZES = ((3, 3), (6, 6), (12, 12))
BIG = 1_000
BATCH = {3: 20000, 6: 10000, 12: 4000}


def _problem(rng: np.random.Generator, m: int, n: int) -> tuple[np.ndarray, ...]:
    J, X = rng.normal(size=(m, n)), rng.normal(size=(m, m))
    return J, X @ X.T / m + 0.1 * np.eye(m), rng.uniform(1, 10, m), rng.uniform(1, 10, n)


def bisection(m: int, n: int) -> Callable[..., float]:
    """The paper's way: bisection over d, an LMI in Q each, parametrised and compiled once."""
    root, d_F = cp.Parameter((m, n)), cp.Parameter((n, m))
    D = cp.Parameter((n, n), diag=True)
    W = cp.Variable((m, m), symmetric=True)  # W = d Q, so that the parameters enter linearly
    block = cp.bmat([[2 * D - root.T @ W @ root, -d_F], [-d_F.T, W]])
    problem = cp.Problem(cp.Minimize(0), [(block + block.T) / 2 >> 0])

    def solve(J: np.ndarray, S: np.ndarray, damping: np.ndarray) -> float:
        root.value, D.value = J, np.diag(damping)
        low, high = 0.0, 2.0 * float(np.max(damping)) / float(np.linalg.norm(J.T @ S @ J, 2))
        high *= len(damping)
        while high - low > 1e-6 * high:
            middle = 0.5 * (low + high)
            d_F.value = middle * (J.T @ S)
            try:
                problem.solve(solver=cp.CLARABEL)
                feasible = problem.status in ("optimal", "optimal_inaccurate")
            except cp.SolverError:
                feasible = False
            low, high = (middle, high) if feasible else (low, middle)
        return low

    return solve


def direct(J: np.ndarray, S: np.ndarray, damping: np.ndarray) -> float:
    """One SDP for the largest d, through CVXPY."""
    m = len(J)
    W, d = cp.Variable((m, m), symmetric=True), cp.Variable()
    F = J.T @ S
    block = cp.bmat([[2 * np.diag(damping) - J.T @ W @ J, -d * F], [-d * F.T, W]])
    cp.Problem(cp.Maximize(d), [(block + block.T) / 2 >> 0]).solve(solver=cp.CLARABEL)
    return float(d.value)


def own_interface(J: np.ndarray, S: np.ndarray, damping: np.ndarray) -> None:
    """The same SDP through Clarabel's own interface."""
    scaled = J / np.sqrt(damping)
    problem = Problem(J=scaled[None], M=(scaled.T @ S)[None], blocks=(len(J),))
    assert "Solved" in ClarabelDirect(tolerance=1e-8).solve(problem).status


def _seconds(call: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def wandering(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Stiffnesses (N, 6, 6) of a random motion, and damping (6,): one multiplier costs delay."""
    rng = np.random.default_rng(5)
    t = np.linspace(0.0, 1.0, count)[:, None, None]
    still, slow, fast = rng.normal(size=(3, 6, 6))
    J = still + 0.6 * np.sin(6.0 * t) * slow + 0.4 * np.cos(17.0 * t) * fast
    return np.swapaxes(J, 1, 2) @ J * 20.0, rng.uniform(5, 50, 6)


def motions() -> None:
    """Print what one multiplier for a motion costs beside one big SDP, and a whole certificate."""
    solve(Problem.of_stiffness(*wandering(10)), share=Motion())
    print("\nOne multiplier for a whole motion, n = 6, bracket closed to 1e-6")
    F, D = wandering(BIG)
    root = 1.0 / np.sqrt(D)
    everything = Problem(J=np.tile(np.diag(root), (BIG, 1, 1)), M=root[:, None] * F, blocks=(6,))
    start = time.perf_counter()
    assert "Solved" in ClarabelDirect(tolerance=1e-8).solve(everything).status
    peer = time.perf_counter() - start
    for count in (BIG, 10_000):
        F, D = wandering(count)
        start = time.perf_counter()
        found = solve(Problem.of_stiffness(F, D), share=Motion())
        own = time.perf_counter() - start
        assert not found.reason, found.reason
        print(
            f"{count:7,d} instants {own:8.2f} s; one SDP with {BIG:,d} instants {peer:8.2f} s, "
            f"{peer / BIG * count / own:6,.0f} x as long an instant"
        )
    system = sealag.load("bundled:hume")
    motion = WalkPlan.over(GroundProfile.paper(), steps=7).motion(system.robot, rate=1600.0)
    spaces = system.spaces(motion)
    start = time.perf_counter()
    certificate = sealag.certify(system, motion)
    own = time.perf_counter() - start
    assert certificate.answer.common_multiplier_delay_s is not None
    instants = np.linspace(0, len(motion) - 1, 5).astype(int)
    start = time.perf_counter()
    for k in instants:
        task = spaces.J_star[k], spaces.stiffness[k], system.actuators.motor_damping
        assert direct(*task) * (1 + 1e-5) >= certificate.evidence.bounds_s[k]
    peer = (time.perf_counter() - start) / len(instants)
    print(
        f"{len(motion):7,d} instants {own:8.2f} s for the certificate of Hume's walk, matrices and "
        f"margin included; bare SDPs, one an instant, {peer * len(motion) / own:,.0f} x as long"
    )


def run() -> None:
    """Print the cost of one certified instant, and of motions, and the ratios to peers."""
    warnings.simplefilter("ignore")
    print("\nLargest delay of Theorem 1, per instant, published form; brackets of 1e-6 certified")
    print(
        f"{'n':>3} {'m':>3} {'sealag':>12} {'bisection':>14} {'ratio':>9}"
        f" {'one SDP':>12} {'ratio':>9} {'Clarabel':>12} {'ratio':>9}"
    )
    rng = np.random.default_rng(1)
    for m, n in SIZES:
        problems = [_problem(rng, m, n) for _ in range(3)]
        count = BATCH[n]
        J, Lambda, K, _ = (
            np.stack(part) for part in zip(*[_problem(rng, m, n) for _ in range(count)])
        )
        gain = np.einsum("ij,jk->ijk", K, np.eye(m))
        D = problems[0][3]
        bound = max_delay(J, Lambda, gain, D, form="published")
        assert bound.width.max() <= 1.01e-6, bound.width.max()
        own = _seconds(partial(max_delay, J, Lambda, gain, D, form="published"), 5) / count
        peer = bisection(m, n)
        slow, single, bare = [], [], []
        for J_1, L_1, K_1, D_1 in problems:
            S = L_1 * K_1
            start = time.perf_counter()
            found = peer(J_1, S, D_1)
            slow.append(time.perf_counter() - start)
            start = time.perf_counter()
            value = direct(J_1, S, D_1)
            single.append(time.perf_counter() - start)
            start = time.perf_counter()
            own_interface(J_1, S, D_1)
            bare.append(time.perf_counter() - start)
            own_bound = max_delay(J_1, L_1, K_1, D_1, form="published")
            assert own_bound.delay <= value * (1 + 1e-5)
            assert abs(found / float(own_bound.delay) - 1.0) < 1e-3
        a, b, c = (statistics.median(times) for times in (slow, single, bare))
        print(
            f"{n:3d} {m:3d} {own * 1e6:9.2f} µs {a * 1e3:11.1f} ms {a / own:9,.0f}"
            f" {b * 1e3:9.1f} ms {b / own:9,.0f} {c * 1e3:9.1f} ms {c / own:9,.0f}"
        )
    motions()
