"""Every key of a project file changes the answer, is refused, or stands by name in assumptions."""

import copy
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import numpy as np
import pytest
from pydantic import BaseModel

import sealag
from helpers.toml import to_toml
from helpers.two_joints import BASE, CONSTANT, PLAIN, URDF
from sealag.errors import SealagError

SINUSOID = {"kind": "sinusoid", "mean_ms": 5.0, "amplitude_ms": 2.0}
TABLE = {"kind": "table", "time_s": [0.0, 1.0], "delay_ms": [4.0, 5.0]}
SAMPLES = {"kind": "samples", "file": "samples.txt", "period_s": 0.01, "quantile": 0.5}
LOSSY = {**CONSTANT, "packet_loss": 0.1}
FLOATING = {
    "robot.base": "floating",
    "contacts": [{"frame": "side", "kind": "surface"}],
    "posture.base_position": [0.0, 0.0, 0.7],
}
TANK = {"controller.feedback": "static_joint_tank", "controller.gravity": "none"}
PUSH = {"frame": "tip", "force_n": [1.0, 0.0, 0.0], "start_s": 0.1, "duration_s": 0.1}
JOINT_PD = {
    "controller": {"kind": "joint_pd", "gravity": "planned", "kp": 60.0, "kd": 1.0},
    "tasks": None,
}
PROGRAM = {"controller": {"kind": "python", "file": "mine.py"}, "tasks": None}
EYE = [[1.0, 0.0], [0.0, 1.0]]
PD = [[-60.0, 0.0, -1.0, 0.0], [0.0, -60.0, 0.0, -1.0]]
FILTER = {
    "kind": "matrices", "A": [[-300.0, 0.0], [0.0, -300.0]], "C": EYE,
    "B": [[0.0, 0.0, -300.0, 0.0], [0.0, 0.0, 0.0, -300.0]], "D": PD,
}  # fmt: skip
MATRICES = {"controller": FILTER, "tasks": None}
FILED = {"controller": {"kind": "matrices", "file": "one.npz"}, "tasks": None}
WALK = {"walking": {"feet": ["tip", "side"]}}
ROUGH, STAIRS = {"kind": "rough"}, {"kind": "stairs", "rises_m": [0.1]}
PRINTED = {"tasks": [{"name": "x", "kind": "posture", "stiffness": [50.0, 9.0]}]}

# Key, what else must be given for it to act, and its other value.
CHANGES: list[tuple[str, dict[str, Any], Any]] = [
    ("robot.urdf", {}, "other.urdf"),
    ("robot.base", {}, "floating"),
    ("robot.actuated", {"tasks": [BASE["tasks"][1]], "actuators.joint": {}}, ["j1"]),
    ("posture.base_position", FLOATING, [0.0, 0.0, 2e4]),
    ("posture.base_quaternion_xyzw", FLOATING, [0.0, 0.38268343, 0.0, 0.92387953]),
    ("posture.joints", {}, {"j1": 0.4, "j2": 0.9}),
    *((f"actuators.default.{key}", {}, value) for key, value in (
        ("spring_stiffness", 340.0), ("rotor_inertia", 0.09), ("inertia_shaping", 0.9),
        ("motor_damping", 12.0), ("spring_damping", 0.4), ("coulomb_friction", 0.3),
        ("viscous_friction", 0.6), ("torque_limit", 0.1), ("velocity_limit", 5.0),
        ("torque_bandwidth", 600.0),
    )),
    *((f"actuators.joint.j1.{key}", {}, value) for key, value in (
        ("spring_stiffness", 340.0), ("rotor_inertia", 0.09), ("inertia_shaping", 0.9),
        ("motor_damping", 12.0), ("spring_damping", 0.4), ("coulomb_friction", 0.3),
        ("viscous_friction", 0.6), ("torque_limit", 0.1), ("velocity_limit", 5.0),
        ("torque_bandwidth", 600.0),
    )),
    ("contacts.frame", FLOATING, "tip"),
    ("contacts.kind", FLOATING, "point"),
    ("controller.feedback", {}, "joint"),
    ("controller.gravity", {}, "planned"),
    ("controller.stiffness_form", {}, "force"),
    ("controller.task_inertia", FLOATING | {"contacts": []}, "lambda_star"),
    ("controller.task_error", {}, "plain"),
    ("controller.criterion", {}, "published"),
    ("controller.tank_flow", TANK, "published"),
    ("controller.tank_energy_j", TANK, 0.0),
    ("controller.tank_rate", TANK, 50.0),
    *((f"controller.{key}", JOINT_PD, value) for key, value in (
        ("kp", 80.0), ("kd", 3.0), ("damping_at", "drive"))),
    *((f"controller.{key}", PROGRAM, value) for key, value in (
        ("file", "other.py"), ("function", "other"))),
    *((f"controller.{key}", MATRICES, value) for key, value in (
        ("A", [[-600.0, 0.0], [0.0, -300.0]]), ("B", [[-1.0, 0.0, -300.0, 0.0], [0.0] * 4]),
        ("C", [[2.0, 0.0], [0.0, 1.0]]), ("D", [[-80.0, 0.0, -1.0, 0.0], PD[1]]),
        ("inputs", ["j2", "j1"]), ("outputs", ["j2", "j1"]), ("time", "discrete"))),
    ("controller.file", FILED, "other.npz"),
    ("tasks.kind", {}, "com"),
    ("tasks.stiffness", {}, 60.0),
    ("tasks.damping", {}, 2.0),
    ("tasks.frame", {}, "lower"),
    ("tasks.joints", PRINTED | {"tasks": [{"name": "x", "kind": "posture", "stiffness": 9.0}]},
     ["j1"]),
    ("tasks.axes", {}, ["x"]),
    ("tasks.priority", {}, 3),
    ("delays.central_round_trip.value_ms", {}, 9.0),
    *((f"delays.central_round_trip.{key}", {"delays.central_round_trip": SINUSOID}, value)
      for key, value in (("mean_ms", 9.0), ("amplitude_ms", 4.0), ("phase_rad", 1.0),
                         ("angular_frequency_rad_s", 7.0))),
    *((f"delays.central_round_trip.{key}", {"delays.central_round_trip": TABLE}, value)
      for key, value in (("time_s", [0.0, 2.0]), ("delay_ms", [4.0, 9.0]))),
    *((f"delays.central_round_trip.{key}", {"delays.central_round_trip": SAMPLES}, value)
      for key, value in (("file", "longer.txt"), ("period_s", 0.5), ("quantile", 0.9))),
    ("delays.central_round_trip.jitter_ms", {}, 2.0),
    ("delays.central_round_trip.packet_loss", {}, 0.2),
    ("delays.central_round_trip.max_burst", {"delays.central_round_trip": LOSSY}, 3),
    ("delays.central_round_trip.order", {}, "newest"),
    ("delays.central_up", {"delays.central_round_trip": None, "delays.central_down": CONSTANT,
                           "delays.central_up": CONSTANT}, {"kind": "constant", "value_ms": 7.0}),
    ("delays.central_down", {"delays.central_round_trip": None, "delays.central_down": CONSTANT,
                             "delays.central_up": CONSTANT}, {"kind": "constant", "value_ms": 7.0}),
    ("delays.embedded_round_trip", {}, {"kind": "constant", "value_ms": 3.0}),
    *((f"delays.embedded_{way}", {
        "delays.embedded_round_trip": None, "delays.embedded_up": CONSTANT,
        "delays.embedded_down": CONSTANT}, {"kind": "constant", "value_ms": 7.0})
      for way in ("up", "down")),
    ("delays.sample_time_ms", {}, 2.0),
    ("delays.embedded_period_ms", {}, 0.5),
    ("delays.delayed_torque_feedback", {}, True),
    ("motion.file", {"motion": {"file": "one.csv"}}, "other.csv"),
    *((f"simulation.{key}", {}, value) for key, value in (
        ("scenario", "track"), ("duration_s", 3.0), ("physics_step_ms", 0.1),
        ("log_period_ms", 20.0), ("model_period_ms", 20.0), ("friction", 0.5),
        ("foot_radius", 0.02), ("foot_half_length", 0.2), ("foot_half_width", 0.2),
        ("torsional_damping", 1.0), ("torsional_radius", 0.1), ("drop_height", 0.1),
        ("track_amplitude", 0.1), ("track_frequency_hz", 2.0), ("seed", 4),
    )),
    *((f"simulation.pushes.{key}", {"simulation": {"pushes": [PUSH]}}, value) for key, value in (
        ("frame", "lower"), ("force_n", [2.0, 0.0, 0.0]), ("start_s", 0.2), ("duration_s", 0.3))),
    *((f"walking.{key}", WALK, value) for key, value in (
        ("feet", ["side", "tip"]), ("steps", 3), ("friction", 0.5),
        ("gait", {"step_time": 0.5}), ("options", {"lead": False}))),
    *((f"walking.terrain.{key}", {"walking": {**WALK["walking"], "terrain": terrain}}, value)
      for terrain, key, value in ((ROUGH, "seed", 3), (ROUGH, "amplitude_m", 0.02),
                                  (STAIRS, "rises_m", [0.2]), (STAIRS, "run_m", 0.6))),
]  # fmt: skip
LABELS = {"tasks.name"}
"""Keys that only say what something is called."""


def walk(kind: Any, path: str = "") -> set[str]:
    """Return the dotted names of all leaves of a schema; `kind` discriminators are no leaves."""
    if get_origin(kind) is Annotated:
        return walk(get_args(kind)[0], path)
    if get_origin(kind) in (Union, UnionType):
        return set().union(*(walk(part, path) for part in get_args(kind) if part is not type(None)))
    inner = get_args(kind)[-1] if get_origin(kind) in (dict, list) else None
    if isinstance(inner, type) and issubclass(inner, BaseModel):
        return walk(inner, f"{path}.j1" if get_origin(kind) is dict else path)
    if isinstance(kind, type) and issubclass(kind, BaseModel):
        found = set()
        for name, field in kind.model_fields.items():
            if name == "kind" and len(get_args(field.annotation)) == 1:
                continue
            found |= walk(field.annotation, f"{path}.{name}".removeprefix("."))
        return found
    return {path}


def schema_keys() -> set[str]:
    keys = walk(type(sealag.load("bundled:hume").source.project))
    ways = {"central_up", "central_down", "embedded_round_trip", "embedded_up", "embedded_down"}
    inside = {key for key in keys if key.split(".")[0] == "delays" and key.split(".")[1] in ways}
    return (keys - inside) | {f"delays.{way}" for way in ways}


def put(project: dict[str, Any], key: str, value: Any) -> None:
    """Set a dotted key, in the first table of a list; None removes it."""
    *path, last = key.split(".")
    at: Any = project
    for part in path:
        at = at[0] if isinstance(at, list) else at
        at = at.setdefault(part, {})
    at = at[0] if isinstance(at, list) else at
    if value is None:
        at.pop(last, None)
    else:
        at[last] = value


def answer(folder: Any, changes: dict[str, Any]) -> tuple[Any, str]:
    """Return what certify says of a project, and its assumptions as one text; of matrices, which it
    refuses, the margins."""
    project = copy.deepcopy(BASE)
    for key, value in changes.items():
        put(project, key, copy.deepcopy(value))
    path = folder / "project.toml"
    path.write_text(to_toml(project))
    try:
        system = sealag.load(path)
        motion = None
        if system.motion_file:
            motion = system.load_motion(system.motion_file)
        if project["controller"].get("kind") == "matrices":
            return system.local_margins(motion).summary(), ""
        found = sealag.certify(system, motion)
    except SealagError as error:
        return str(error), ""
    numbers = found.summary()
    assumptions = numbers.pop("assumptions")
    for name in ("hashes", "versions"):
        numbers.pop(name)
    return numbers, " ".join(one["text"] for one in assumptions)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("keys")
    (made / "two.urdf").write_text(URDF.format(**PLAIN))
    (made / "other.urdf").write_text(
        URDF.format(**PLAIN).replace('mass value="2"', 'mass value="4"')
    )
    (made / "mine.py").write_text("def controller(system):\n    return None\n")
    np.savez(made / "one.npz", D=np.array(PD))
    np.savez(made / "other.npz", D=2.0 * np.array(PD))
    (made / "samples.txt").write_text("4\n5\n6\n7\n")
    (made / "longer.txt").write_text("8\n9\n9\n9\n")
    (made / "one.csv").write_text("time_s,j1,j2\n0,0.4,0.5\n1,0.5,0.5\n")
    (made / "other.csv").write_text("time_s,j1,j2\n0,0.4,0.9\n1,0.5,0.9\n")
    return made


def named(key: str, text: str) -> bool:
    """Whether a key, or the table that it stands in, is named in a text."""
    parts = key.split(".")
    return any(part in text for part in parts[1:])


def silent(folder: Any, key: str, given: dict[str, Any], value: Any) -> bool:
    """Whether a change of a key says nothing."""
    before, _ = answer(folder, given)
    after, assumptions = answer(folder, {**given, key: value})
    return before == after and not named(key, assumptions)


@pytest.mark.parametrize(("key", "given", "value"), CHANGES, ids=[key for key, _, _ in CHANGES])
def test_no_key_is_silent(folder, key, given, value):
    assert not silent(folder, key, given, value)


def test_every_key_of_the_schema_is_tried():
    assert schema_keys() == {key for key, _, _ in CHANGES} | LABELS


def test_a_silent_key_is_noticed(folder):
    assert silent(folder, "tasks.name", {}, "renamed")
    before, _ = answer(folder, {})
    assert answer(folder, {"controller.nonsense": 1}) != before


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("damping", 0.8, ""),
        ("friction", 0.4, "friction"),
        ("effort", 0.2, ""),
        ("velocity", 0, "0"),
    ],
)
def test_no_field_of_a_urdf_is_silent(folder, field, value, words):
    before, assumed = answer(folder, {})
    (folder / "field.urdf").write_text(URDF.format(**{**PLAIN, field: value}))
    after, then = answer(folder, {"robot.urdf": "field.urdf"})
    assert before != after or (assumed != then and words in then)
