"""The work of a command that is known at instants, against trapezoids in NumPy."""

import numpy as np

from sealag.kernels import keep, run


def _carried(theta: np.ndarray, command: np.ndarray) -> run.Undelayed:
    done = run.allocate_undelayed(theta.shape[1])
    kept = keep(done)
    for here, force in zip(theta, command, strict=True):
        done.command[2] = force
        run.carry_work(kept, here)
    return done


def _trapezoids(theta: np.ndarray, command: np.ndarray) -> np.ndarray:
    return 0.5 * (command[1:] + command[:-1]) * np.diff(theta, axis=0)


def test_work_is_the_trapezoid_and_its_bound_what_every_second_row_gives_otherwise() -> None:
    rng = np.random.default_rng(5)
    theta, command = rng.normal(size=(2, 9, 3))
    done, parts = _carried(theta, command), _trapezoids(theta, command)
    np.testing.assert_allclose(done.work, parts.sum(axis=0), rtol=1e-13)
    single = parts.sum(axis=1)
    wide = 0.5 * ((command[2:] + command[:-2]) * (theta[2:] - theta[:-2])).sum(axis=1)
    rough = 0.5 * np.abs(wide - single[1:] - single[:-1]).sum()
    np.testing.assert_allclose(done.rough[0], rough, rtol=1e-13)
    assert done.instants[0] == len(theta)


def test_no_work_before_the_second_instant_and_no_bound_before_the_third() -> None:
    theta, command = np.array([[1.0], [3.0], [4.0]]), np.array([[2.0], [4.0], [-1.0]])
    assert _carried(theta[:1], command[:1]).work[0] == 0.0
    two = _carried(theta[:2], command[:2])
    assert (two.work[0], two.rough[0]) == (6.0, 0.0)
    assert _carried(theta, command).rough[0] == 0.5 * abs(0.5 * 1.0 * 3.0 - 6.0 - 1.5)


def test_bound_holds_the_error_of_a_smooth_motion() -> None:
    """The check has teeth: one interval in two leaves an error four times as large."""
    time = np.linspace(0.0, 2.0, 41)
    theta, command = np.sin(3.0 * time)[:, None], np.cos(2.0 * time)[:, None]
    fine = np.linspace(0.0, 2.0, 400_001)
    exact = _trapezoids(np.sin(3.0 * fine)[:, None], np.cos(2.0 * fine)[:, None]).sum()
    done, coarse = _carried(theta, command), _carried(theta[::2], command[::2])
    error = abs(done.work[0] - exact)
    assert error < done.rough[0] < 0.1
    assert abs(coarse.work[0] - exact) > 3.0 * error
