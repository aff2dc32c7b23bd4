"""A control tick beside those of PlaCo, TSID and Pink on the same robot."""

import itertools
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from bench.peers.timing import median_us
from sealag.design import load
from sealag.whole_body import Controller, Measurement, Signal

ANYMAL = "anymal_b_simple_description/robots/anymal.urdf"
PEERS = Path(__file__).with_name("peers")


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A solver that needs another Pinocchio than sealag.

    Attributes:
        name: what it is called.
        script: the file of `bench/peers` that times it.
        requirements: what its environment holds.
    """

    name: str
    script: str
    requirements: tuple[str, ...]


OTHERS = (
    Peer(name="PlaCo", script="placo_tick.py", requirements=("placo==0.10.2",)),
    Peer(
        name="TSID",
        script="tsid_tick.py",
        requirements=(
            "tsid==1.7.1", "pin==3.4.0", "cmeel-urdfdom<5", "cmeel-tinyxml2==10.0.0", "numpy<2.3",
        ),
    ),
)  # fmt: skip


def _ours(signal: str) -> Callable[[], object]:
    system = load("examples/anymal.toml")
    robot = system.robot
    controller = Controller(
        robot,
        replace(system.law, signal=Signal.named(signal)),
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

    system = load("examples/anymal.toml")
    q = system.posture
    model = pin.buildModelFromUrdf(str(system.robot.urdf_path), pin.JointModelFreeFlyer())
    configuration = pink.Configuration(model, model.createData(), q)
    tasks = [FrameTask(f"{leg}_FOOT", 1.0, 0.0) for leg in ("LF", "RF", "LH", "RH")]
    tasks += [ComTask(1.0), FrameTask("base", 0.0, 1.0), PostureTask(1e-3)]
    for task in tasks:
        task.set_target_from_configuration(configuration)

    def tick() -> object:
        configuration.update(q)
        return pink.solve_ik(configuration, tasks, 1e-3, solver="daqp", limits=[])

    return tick


def _environment(peer: Peer) -> Path:
    """Return the interpreter of a peer's environment, built at its first use."""
    folder = PEERS / ".environments" / peer.name.lower()
    python = folder / "bin" / "python"
    if not (folder / "ready").exists():
        print(f"  (building an environment for {peer.name})", flush=True)
        subprocess.run([sys.executable, "-m", "venv", "--clear", folder], check=True)
        subprocess.run([python, "-m", "pip", "install", "-qqq", *peer.requirements], check=True)
        (folder / "ready").touch()
    return python


def _without_meshes(folder: Path) -> Path:
    """Write the robot without visuals and collision shapes, which PlaCo would look for."""
    tree = ElementTree.parse(load("examples/anymal.toml").robot.urdf_path)
    for link in tree.getroot().iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            link.remove(shape)
    path = folder / "anymal.urdf"
    tree.write(path)
    return path


def _other_us(peer: Peer, urdf: Path) -> float:
    """Return the microseconds of a peer's tick, timed in its own process."""
    q = " ".join(repr(float(value)) for value in load("examples/anymal.toml").posture)
    call = [_environment(peer), PEERS / peer.script, urdf, q]
    done = subprocess.run(call, check=True, capture_output=True, text=True)
    return float(done.stdout)


def run() -> None:
    """Print microseconds a tick on ANYmal with four feet, and the ratios."""
    print("\nOne control tick, ANYmal, four point feet, CoM and base orientation")
    own = {name: median_us(_ours(name)) for name in Signal.names()}
    for name, value in own.items():
        print(f"  sealag, {name:18} {value:7.1f} µs (torques)")
    with tempfile.TemporaryDirectory() as folder:
        urdf = _without_meshes(Path(folder))
        peers = {peer.name: _other_us(peer, urdf) for peer in OTHERS}
    for name, value in peers.items():
        print(f"  {name:26} {value:7.1f} µs (torques, by a QP)")
    peers["Pink"] = median_us(_pink())
    print(f"  Pink                       {peers['Pink']:7.1f} µs (velocities, a smaller problem)")
    slowest = max(own.values())
    for name, value in peers.items():
        print(f"  {name} / slowest signal of sealag {value / slowest:5.2f}")
