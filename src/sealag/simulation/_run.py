"""What a run leaves behind: arrays over its logged instants, its events and its end."""

from dataclasses import dataclass

from sealag.errors import InputError
from sealag.simulation._audit import Audit
from sealag.simulation._delay_store import delay_store
from sealag.simulation._exchange import Ages
from sealag.simulation._outcome import Outcome
from sealag.simulation._plant import ContactEvent
from sealag.typing import Array, IntArray

LARGEST_LOG_BYTES = 4_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A simulated run, N logged instants; SI units.

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


def refuse_large(rows: int, numbers: int) -> None:
    """Refuse a log that would not fit into memory.

    Args:
        rows: How many instants there will be at most.
        numbers: How many numbers each has.

    Raises:
        InputError: It would not.
    """
    size = 8 * rows * numbers
    if size > LARGEST_LOG_BYTES:
        raise InputError(
            f"The run would record {rows:.4g} instants in {size / 1e9:.4g} GB of memory, more "
            f"than {LARGEST_LOG_BYTES / 1e9:g} GB; log less often (simulation.log_period_ms, "
            "--log-ms), or simulate for a shorter time."
        )
