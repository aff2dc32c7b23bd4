"""A control tick beside Pink's on the same robot."""

import itertools
import statistics
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from sealag.design import load
from sealag.whole_body import SIGNAL_NAMES, Controller, Measurement, signal_named

BLOCKS, TICKS = 7, 300


def _median_us(call: Callable[[], object]) -> float:
    call()
    times = []
    for _ in range(BLOCKS):
        start = time.perf_counter()
        for _ in range(TICKS):
            call()
        times.append((time.perf_counter() - start) / TICKS)
    return statistics.median(times) * 1e6


def _ours(signal: str) -> Callable[[], object]:
    system = load("examples/anymal.toml")
    robot = system.robot
    controller = Controller(
        robot,
        replace(system.law, signal=signal_named(signal)),
        system.actuators,
        contacts=system.contacts,
        posture=system.posture,
    )
    measurements = []
    for away in (0.01, 0.012):  # changing, so that q̄(θ) has something to find
        measurement = Measurement.allocate(nq=robot.nq, nv=robot.nv, n=robot.n)
        measurement.q[:] = system.posture
        measurement.theta[:] = robot.joint_positions(system.posture) + away
        measurements.append(measurement)
    out, turn = np.zeros(robot.n), itertools.cycle(measurements)
    clock = itertools.count()
    controller.reset(0.0, measurements[0])
    return lambda: controller.tick(1e-3 * next(clock), next(turn), out)


def _pink() -> Callable[[], object]:
    """Pink: feet, base and posture tasks, one differential IK step through DAQP."""
    import pink
    import pinocchio as pin
    from pink.tasks import ComTask, FrameTask, PostureTask

    from sealag.robot import example_robot_path

    path = example_robot_path("anymal_b_simple_description/robots/anymal.urdf")
    model = pin.buildModelFromUrdf(str(path), pin.JointModelFreeFlyer())
    q = load("examples/anymal.toml").posture
    configuration = pink.Configuration(model, model.createData(), q)
    tasks = [FrameTask(f"{leg}_FOOT", 1.0, 0.0) for leg in ("LF", "RF", "LH", "RH")]
    tasks += [ComTask(1.0), FrameTask("base", 0.0, 1.0), PostureTask(1e-3)]
    for task in tasks:
        task.set_target_from_configuration(configuration)

    def tick() -> object:
        configuration.update(q)
        return pink.solve_ik(configuration, tasks, 1e-3, solver="daqp", limits=[])

    return tick


def run() -> None:
    """Print microseconds a tick on ANYmal with four feet, and the ratios."""
    print("\nOne control tick, ANYmal, four point feet, CoM and base orientation")
    own = {name: _median_us(_ours(name)) for name in SIGNAL_NAMES}
    for name, value in own.items():
        print(f"  sealag, {name:18} {value:7.1f} µs (torques from dynamics)")
    peer = _median_us(_pink())
    print(f"  Pink                       {peer:7.1f} µs (velocities, a smaller problem)")
    for name in ("motor", "static_joint_tank"):
        print(f"  ratio Pink / {name:18} {peer / own[name]:5.1f}")
