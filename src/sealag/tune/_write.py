"""Gains written into the project file's text, with its comments and order kept."""

from collections.abc import MutableMapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import tomlkit

from sealag.design import System, load
from sealag.toml import table_in, text_of
from sealag.tune._question import pd_keys
from sealag.typing import Array, ArrayLike


def as_file(before: System, after: System) -> System:
    """Return a design as its own project file will describe it.

    Args:
        before: the design that the file describes now.
        after: the same with other gains; numbers have few digits already.

    Returns:
        The design that is read from the edited text; `after` if there is no file.

    Raises:
        InputError: the file's dotted keys leave no place for the gains.
    """
    source = before.source
    if source is None:
        return after
    document = tomlkit.parse(source.text)
    old, new, joints = before.actuators, after.actuators, after.robot.joints
    if pd_keys(before):
        _put_pd(document, before, after)
    else:
        for table, was, task in zip(document["tasks"], before.law.tasks, after.law.tasks):
            if not np.array_equal(was.stiffness, task.stiffness):
                table["stiffness"] = _plain(task.stiffness)
            if not np.array_equal(was.damping, task.damping):
                table["damping"] = _plain(task.damping)
        damping = old.motor_damping, new.motor_damping
        _put_drives(document, "motor_damping", joints, *damping)
    if not np.array_equal(old.shaped_inertia, new.shaped_inertia):
        shaping = _tidy(old.inertia_shaping), _tidy(new.inertia_shaping)
        _put_drives(document, "inertia_shaping", joints, *shaping)
    text = text_of(
        document,
        refusal=f"{source.files[0]}: the gains cannot be written beside its dotted keys; give each "
        "joint a table of its own, [actuators.joint.NAME].",
    )
    read = load(source.files[0], text=text)
    return replace(read, delays=after.delays)


def _plain(values: ArrayLike) -> Any:
    return np.asarray(values, dtype=float).tolist()


def _put_pd(document: Any, before: System, after: System) -> None:
    """Write kp, and kd where it is computed."""
    controller, joints = document["controller"], after.robot.joints
    old, new = before.law.tasks[0], after.law.tasks[0]
    if not np.array_equal(old.stiffness, new.stiffness):
        _put_each(controller, "kp", joints, new.stiffness)
    moved = not np.array_equal(before.actuators.motor_damping, after.actuators.motor_damping)
    if damps_late(before) and moved:  # the drives take over
        controller["damping_at"] = "drive"
        _put_each(controller, "kd", joints, drive_kd(after, before.actuators.motor_damping))
    elif damps_late(before):
        late = np.broadcast_to(new.damping, len(joints))
        if not np.array_equal(np.broadcast_to(old.damping, len(joints)), late):
            _put_each(controller, "kd", joints, late)
    elif moved:
        _put_each(controller, "kd", joints, drive_kd(after, base_damping(before)))


def kd_of_file(system: System) -> Array:
    """Return K_d as a project's joint PD states it, (n,) Nms/rad.

    Args:
        system: a design under joint PD.
    """
    keys: Any = pd_keys(system)
    kd = keys.kd
    return np.array([kd[name] if isinstance(kd, dict) else kd for name in system.robot.joints])


def damps_late(system: System) -> bool:
    """Return whether the controller computes the damping of joint PD, which is late then.

    Args:
        system: a design under joint PD.
    """
    keys: Any = pd_keys(system)
    return keys.damping_at == "controller"


def base_damping(system: System) -> Array:
    """Return the motors' own damping under joint PD, below which none can be set, (n,) Nms/rad.

    Without joint PD motor damping is free, and that is 0.

    Args:
        system: a design.
    """
    if pd_keys(system) is None:
        return np.zeros(system.robot.n)
    if damps_late(system):
        return system.actuators.motor_damping
    return _tidy(system.actuators.motor_damping - kd_of_file(system))


def drive_kd(system: System, base: Array) -> Array:
    """Return what joint PD adds to the motors' own damping, rounded to 12 digits, (n,) Nms/rad.

    Args:
        system: the design with all its damping.
        base: (n,) the motors' own.
    """
    return _tidy(system.actuators.motor_damping - base)


def _tidy(difference: Array) -> Array:
    """A difference without the last digits, which rounding made; 0 instead of a negative one."""
    return np.array([float(f"{max(value, 0.0):.12g}") for value in np.round(difference, 12)])


def _put_each(table: Any, key: str, names: Sequence[str], values: Array) -> None:
    """Write one number if all are alike and one stood there, else one for each name."""
    alike = bool(np.ptp(values) == 0.0)
    if isinstance(table.get(key), MutableMapping):
        for name, value in zip(names, values.tolist()):
            table[key][name] = value
    elif alike:
        table[key] = float(values[0])
    else:
        each = tomlkit.inline_table()
        each.update(dict(zip(names, values.tolist())))
        table[key] = each


def _put_drives(document: Any, key: str, joints: Sequence[str], old: Array, new: Array) -> None:
    """Write a quantity of the drives where it differs from what stands there."""
    actuators = document["actuators"]
    if "joint" not in actuators:
        actuators["joint"] = table_in(actuators, header=False)
    for name, was, value in zip(joints, old.tolist(), new.tolist()):
        if was == value:
            continue
        if name not in actuators["joint"]:
            actuators["joint"][name] = table_in(actuators["joint"])
        table = actuators["joint"][name]
        table[key] = value
    if not actuators["joint"]:
        del actuators["joint"]
