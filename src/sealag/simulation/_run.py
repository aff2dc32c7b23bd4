"""What a run leaves behind: arrays over its logged instants, its events and its end."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sealag.extras import extra
from sealag.robot import Motion
from sealag.simulation._audit import Audit
from sealag.simulation._delay_store import delay_store
from sealag.simulation._exchange import Ages
from sealag.simulation._outcome import Outcome
from sealag.simulation._plant import ContactEvent
from sealag.store import blocks, release
from sealag.typing import Array, IntArray

_STICKING = 1
"""Mode of a contact point that neither slips nor is open."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A simulated run, N logged instants; SI units.

    The arrays of a large run lie in files without a name in the temporary folder and are read as
    they are used; `blocks` goes through them in little memory.

    Attributes:
        outcome: How it ended.
        message: One sentence about the end; empty when completed.
        seed: Seed of jitter and losses.
        joints: Names of the n actuated joints.
        feet: Frame of each of the P contact points.
        time: Instants (N,), s.
        q: Configurations (N, nq).
        v: Velocities (N, nv).
        theta: Motor angles (N, n), rad.
        theta_dot: Motor speeds (N, n), rad/s.
        tau_sea: Spring torques (N, n), Nm.
        tau_motor: Motor torques (N, n), Nm.
        tau_command: Command that the central controller last sent (N, n), Nm.
        tau_osc: Command as it acts at the motors, delayed (N, n), Nm.
        measurement_age: Age of the measurement behind ``tau_command`` (N,), s.
        command_age: Age of the command in ``tau_osc`` (N,), s.
        ages: The largest of these ages between the logged instants too.
        contact_mode: 0 open, 1 sticking, 2 slipping (N, P).
        contact_force: Forces in the contact frames, normal last (N, P, 3), N.
        events: Touchdowns and lift-offs in order.
        audit: Where every joule went.
    """

    outcome: Outcome
    message: str
    seed: int
    joints: tuple[str, ...]
    feet: tuple[str, ...]
    time: Array
    q: Array
    v: Array
    theta: Array
    theta_dot: Array
    tau_sea: Array
    tau_motor: Array
    tau_command: Array
    tau_osc: Array
    measurement_age: Array
    command_age: Array
    ages: Ages
    contact_mode: IntArray
    contact_force: Array
    events: tuple[ContactEvent, ...]
    audit: Audit

    def delay_storage(self, Y: Array, *, delay: float) -> tuple[Array, float]:
        """Return V_4, the energy that a delay stores, at the logged instants, and its error, J.

        Args:
            Y: The multiplier (n, n) of the certificate, Nms²/rad.
            delay: d, s, positive.

        Returns:
            V_4 (N,) and a bound of its error.
        """
        return delay_store(self.time, self.theta, self.theta_dot, Y, delay=delay)

    def blocks(self, rows: int = 500) -> Iterator[slice]:
        """Go through the rows block by block, in little memory however long the run is.

        Args:
            rows: How many rows a block has at most.

        Yields:
            The rows of a block, as in ``run.theta[rows]``.
        """
        for block in blocks(len(self.time), rows):
            yield block
            for part in (self, self.audit):
                for name in part.__dataclass_fields__:
                    value = getattr(part, name)
                    release(*value.values() if isinstance(value, dict) else [value])

    def signals(self, rows: slice = slice(None)) -> dict[str, dict[str, Array]]:
        """Return what a recording holds besides joint states and poses of links.

        Args:
            rows: Of which logged instants.

        Returns:
            By topic, such as ``/torque/command``, the columns by name, each (N,), with the unit at
            the end of the name.
        """
        by_joint = {
            "/motor/position": (self.theta, "rad"),
            "/motor/velocity": (self.theta_dot, "rad_s"),
            "/torque/command": (self.tau_command, "nm"),
            "/torque/acting": (self.tau_osc, "nm"),
            "/torque/spring": (self.tau_sea, "nm"),
            "/torque/motor": (self.tau_motor, "nm"),
        }
        found = {"/base": self._base(rows)}
        found |= {
            topic: self._by_joint(values[rows], unit) for topic, (values, unit) in by_joint.items()
        }
        rates = self.v[rows, -len(self.joints) :]
        found |= {
            "/delay": _ages(self, rows),
            "/energy": _energies(self, rows),
            "/work": _works(self, rows),
            "/power/port": self._by_joint(self.tau_sea[rows] * rates, "w"),  # to the links
            "/contact": _contacts(self, rows),
        }
        return {topic: columns for topic, columns in found.items() if columns}

    def _base(self, rows: slice) -> dict[str, Array]:
        """Pose and velocity of a floating base, named as in a motion file."""
        joints = len(self.joints)
        if self.q.shape[1] == joints:
            return {}
        names = (
            *Motion.position_columns((), floating_base=True),
            *Motion.velocity_columns((), floating_base=True),
        )
        return dict(zip(names, (*self.q[rows, :-joints].T, *self.v[rows, :-joints].T), strict=True))

    def _by_joint(self, values: Array, unit: str) -> dict[str, Array]:
        return {f"{joint}_{unit}": one for joint, one in zip(self.joints, values.T, strict=True)}

    @staticmethod
    def held(contact: Mapping[str, Array]) -> dict[str, Array]:
        """Return whether each foot holds: all points of its frame stick, none is open or slips.

        Args:
            contact: The signals of the topic ``/contact``.

        Returns:
            By frame, (N,) truth values.
        """
        modes = {
            name.removesuffix("_mode"): values
            for name, values in contact.items()
            if name.endswith("_mode")
        }
        found: dict[str, Array] = {}
        for point, values in modes.items():
            numbered = re.fullmatch(r"(.+)_\d+", point)
            frame = numbered[1] if numbered and f"{numbered[1]}_0" in modes else point
            found[frame] = found.get(frame, True) & (values == _STICKING)
        return found

    def to_pandas(self) -> Any:
        """Return the run as a DataFrame of pandas, a row a logged instant.

        Configurations and velocities are named as in a motion file, ``base_x … base_qw``, the
        joints, ``base_vx … base_wz``, ``<joint>:velocity`` and ``contact:<frame>``, so that its CSV
        is one; the rest by topic and name of the recording, such as
        ``torque/command/left_knee_nm``. All of it is read into memory.

        Returns:
            The DataFrame; its index is ``time_s``.

        Raises:
            InputError: pandas is not installed.
        """
        pandas = extra("pandas", use="Run.to_pandas")
        signals = self.signals()
        columns = signals.pop("/base", {})
        n = len(self.joints)
        columns |= dict(zip(self.joints, self.q.T[-n:], strict=True))
        rates = Motion.velocity_columns(self.joints, floating_base=False)
        columns |= dict(zip(rates, self.v.T[-n:], strict=True))
        held = self.held(signals.get("/contact", {}))
        columns |= {f"contact:{frame}": values.astype(float) for frame, values in held.items()}
        for topic, named in signals.items():
            columns |= {f"{topic[1:]}/{name}": values for name, values in named.items()}
        return pandas.DataFrame(columns, index=pandas.Index(self.time, name="time_s"))

    def summary(self, *, recording: Path) -> dict[str, Any]:
        """Return what it comes to: the numbers of its JSON answer.

        Args:
            recording: The file that holds it.
        """
        books = self.audit
        joint, central, delay = books.joint_side, books.controller_side, books.delay_side
        at_port = books.controller_port
        return {
            "outcome": self.outcome.value,
            "message": self.message,
            "duration_s": float(self.time[-1]),
            "seed": self.seed,
            "recording": str(recording),
            "largest_joint_speed_rad_s": _largest_size(self.theta_dot),
            "largest_spring_torque_nm": _largest_size(self.tau_sea),
            "measurement_age_s": self.ages.measurement,
            "command_age_s": self.ages.command,
            "total_age_s": self.ages.total,
            "energy_residual_j": _largest_size(books.residual),
            "energy_throughput_j": float(books.throughput[-1]),
            "joint_side_passive": joint.passive,
            "controller_side_passive": central.passive if central else None,
            "controller_side_slack_j": float(central.slack.min()) if central else None,
            "first_violation_s": central.first_violation if central else None,
            "violating_joint": central.joint if central else None,
            "joint_port_passive": books.joint_port.passive,
            "controller_port_passive": at_port.passive if at_port else None,
            "delay_side_passive": delay.passive if delay else None,
            "delay_side_slack_j": float(delay.slack.min()) if delay else None,
            "delay_injection_j": _largest(books.delay_injection),
            "law_injection_j": _largest_magnitude(books.law_injection),
            "injection_error_j": books.injection_error,
            "delay_storage_j": _largest(books.delay_storage),
            "delay_storage_error_j": books.delay_storage_error,
            "tank_j": float(books.tank[-1]) if books.tank is not None else None,
            "touchdowns": sum(event.kind.value == "touchdown" for event in self.events),
        }


def _ages(run: Run, rows: slice) -> dict[str, Array]:
    return {"measurement_s": run.measurement_age[rows], "command_s": run.command_age[rows]}


def _energies(run: Run, rows: slice) -> dict[str, Array]:
    """What is stored, and what the books of the first law leave open."""
    books = run.audit
    named = {
        **books.stores,
        "controller": books.controller_storage,
        "tank": books.tank,
        "delay_line": books.delay_storage,
        "residual": books.residual,
    }
    return {f"{name}_j": values[rows] for name, values in named.items() if values is not None}


def _works(run: Run, rows: slice) -> dict[str, Array]:
    """Works since the start by mechanism, and the slack of each passivity observer."""
    books = run.audit
    sides = {
        "joint_side_slack": books.joint_side,
        "controller_side_slack": books.controller_side,
        "delay_side_slack": books.delay_side,
        "joint_port_slack": books.joint_port,
        "controller_port_slack": books.controller_port,
    }
    named = {
        **books.scalar_flows,
        "inertia_shaping": books.inertia_shaping,
        "delay_injection": books.delay_injection,
        "law_injection": books.law_injection,
        **{name: None if side is None else side.slack for name, side in sides.items()},
    }
    works = {name: works[rows].sum(axis=1) for name, works in books.joint_flows.items()}
    works |= {name: values[rows] for name, values in named.items() if values is not None}
    return {f"{name}_j": values for name, values in works.items()}


def _contacts(run: Run, rows: slice) -> dict[str, Array]:
    """Mode (0 open, 1 sticking, 2 slipping) and force of each contact point."""
    columns: dict[str, Array] = {}
    for point, foot in enumerate(run.feet):
        number = run.feet[:point].count(foot)
        name = f"{foot}_{number}" if run.feet.count(foot) > 1 else foot
        columns[f"{name}_mode"] = run.contact_mode[rows, point].astype(float)
        for axis, way in enumerate(("tangent_1", "tangent_2", "normal")):
            columns[f"{name}_{way}_n"] = run.contact_force[rows, point, axis]
    return columns


def _largest(values: Array | None) -> float | None:
    return None if values is None else float(values.max())


def _largest_size(values: Array) -> float:
    return max(float(values.max()), -float(values.min()))


def _largest_magnitude(values: Array | None) -> float | None:
    """The value that is furthest from 0, with its sign."""
    return None if values is None else float(values[np.abs(values).argmax()])
