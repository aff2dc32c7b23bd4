"""Simulated delay equations decay just below the margin and grow just above it."""

import jitcdde
import numpy as np

from humanoids2016 import random_sea_plant
from sealag.margin import DelayedLoop


def growth(A_0: np.ndarray, A_1: np.ndarray, *, delay: float, omega: float, mode) -> float:
    """Growth rate along the crossing mode, 1/s, from a simulation of a few periods."""
    dde = jitcdde.jitcdde(
        [
            sum(A_0[i, j] * jitcdde.y(j) for j in range(len(A_0)) if A_0[i, j])
            + sum(A_1[i, j] * jitcdde.y(j, jitcdde.t - delay) for j in range(len(A_0)) if A_1[i, j])
            for i in range(len(A_0))
        ],
        max_delay=delay,
        verbose=False,
    )
    for time in np.linspace(-1.2 * delay, 0.0, 40):
        turning = np.exp(1j * omega * time) * mode
        dde.add_past_point(time, turning.real, (1j * omega * turning).real)
    dde.compile_C(simplify=False, do_cse=False, extra_compile_args=["-O1"])
    dde.set_integration_parameters(rtol=1e-7, atol=1e-9)
    dde.adjust_diff()
    period = 2.0 * np.pi / omega
    times = dde.t + period * np.linspace(0.0, 3.0, 49)
    states = np.array([dde.integrate(time) for time in times])
    amplitude = [np.linalg.norm(states[i * 16 : (i + 1) * 16 + 1]) for i in range(3)]
    return float(np.log(amplitude[2] / amplitude[0]))


def plants() -> list[int]:
    found = []
    for seed in range(200):
        plant = random_sea_plant(seed, joints=1 + seed % 2)
        answer = DelayedLoop(plant.A_0, plant.A_1, symmetries=plant.symmetries).margin()
        fast = np.abs(np.linalg.eigvals(plant.A_0)).max()
        if 0.0 < answer.delay < 10.0 and not answer.neutral and fast < 60.0 * answer.frequency:
            found.append(seed)
        if len(found) == 20:
            break
    return found


def test_simulation_agrees_just_below_and_just_above() -> None:
    seeds = plants()
    assert len(seeds) == 20
    for seed in seeds:
        plant = random_sea_plant(seed, joints=1 + seed % 2)
        answer = DelayedLoop(plant.A_0, plant.A_1).margin()
        common = {"omega": answer.frequency, "mode": answer.mode}
        below = growth(plant.A_0, plant.A_1, delay=0.97 * answer.delay, **common)
        above = growth(plant.A_0, plant.A_1, delay=1.03 * answer.delay, **common)
        assert below < 0.0 < above, (seed, below, above)
