"""Assumptions of a certificate: one list, each with a key that does not change."""

from collections.abc import Iterator

import numpy as np

from sealag.design._design import Design
from sealag.design._local import Local
from sealag.passivity import Assumption, Basis, Criterion
from sealag.robot import Motion
from sealag.units import time_text
from sealag.whole_body import GravityCompensation, Tank, TaskError


def assumptions_of(
    system: Design, motion: Motion, criterion: Criterion, local: Local
) -> tuple[Assumption, ...]:
    """Return the assumptions of a design's certificate.

    Each entry of a design that changes a run, but neither the bound nor the margin, is listed here
    by its key.

    Args:
        system: the design.
        motion: what was certified.
        criterion: the criterion that was used.
        local: what is known of stability.
    """
    parts = (_of_the_proof(system, motion, criterion), _of_stability(motion, local))
    parts += (_of_delays(system), _of_the_law(system), _of_drives(system), _of_contacts(system))
    return tuple(Assumption(key=key, text=text) for part in parts for key, text in part)


def _of_the_proof(
    system: Design, motion: Motion, criterion: Criterion
) -> Iterator[tuple[str, str]]:
    yield (
        "frozen_coefficients",
        "J* and S are frozen at each instant, and each instant has a multiplier of its own; "
        "common_multiplier_delay_s is the bound with a single one.",
    )
    if len(motion) > 1:
        yield (
            "instants",
            "The motion is checked at its instants, not between them; each instant is a "
            "configuration that is held.",
        )
    if motion.stiffness is not None:
        rate = np.diff(np.log(motion.stiffness)) / np.diff(motion.time)
        yield (
            "schedule",
            f"The gains follow the motion's stiffness_factor, {motion.stiffness.min():.4g} to "
            f"{motion.stiffness.max():.4g}, at its time. While they grow, by up to "
            f"{max(float(rate.max(initial=0.0)), 0.0):.3g} of themselves a second, they put up to "
            "that share of the tasks' potential into the loop each second, which no bound counts; "
            "`sealag simulate` runs the gains of the project.",
        )
    if criterion is Criterion.PUBLISHED:
        yield (
            "published_criterion",
            "The criterion is (29)/(31) as printed: it assumes that Λ K_x is symmetric, that x(θ) "
            "is fed back and that gravity compensation is not delayed, and can certify an unstable "
            "loop.",
        )


def _of_stability(motion: Motion, local: Local) -> Iterator[tuple[str, str]]:
    yield (
        "passivity_is_not_stability",
        "Passivity does not imply stability; see stable and local_margin_s, which hold for the "
        "law that runs, linearised where it rests, at constant delay.",
    )
    if len(motion) > 1:
        yield (
            "instants_decided",
            f"Stability was decided exactly at {local.count(Basis.EXACT)} of {len(motion)} "
            f"instants, by the passive bound at {local.count(Basis.BOUND)}, by a search for "
            f"earlier crossings at {local.count(Basis.SEARCHED)}, and not at "
            f"{local.count(Basis.OPEN)}.",
        )
    if local.problem:
        yield "critical_instant", f"At the critical instant {local.problem.rstrip('.')}."


def _of_delays(system: Design) -> Iterator[tuple[str, str]]:
    delays = system.delays
    yield (
        "delay_bound",
        f"d_1 is at most {time_text(delays.d_1)}, with the hold of a controller period of "
        f"{time_text(delays.sample_time)} (sample_time_ms; 1 ms where the design states none); it "
        "may vary below that in any way (order, "
        "phase_rad, angular_frequency_rad_s, time_s and period_s of the delays shape a run only).",
    )
    ways = {
        "central_up": delays.central.up,
        "central_down": delays.central.down,
        "embedded_down": delays.embedded.down,
    }
    left_out = [
        f"{share:.1%} of the packets on the way {name}"
        for name, link in ways.items()
        if (share := link.delay.left_out)
    ]
    if left_out:
        yield (
            "delay_quantile",
            f"The quantile of the samples excludes {' and '.join(left_out)}: these are later than "
            "the bound, and nothing is certified for them.",
        )
    yield (
        "one_delay",
        "Only the sum d_1 of the ways up and down matters; d_2 delays the feedforward of a "
        "moving reference (velocity_feedforward) and changes no root.",
    )
    if not delays.delayed_torque_feedback:
        yield (
            "torque_feedback",
            "Motor damping and torque feedback act in the drives without delay; nothing on the "
            "way embedded_up is fed back.",
        )


def _of_the_law(system: Design) -> Iterator[tuple[str, str]]:
    law = system.law
    if law.gravity is GravityCompensation.PLANNED:
        yield (
            "planned_gravity",
            "Gravity compensation comes from the plan and has no feedback gradient.",
        )
    if isinstance(law.signal, Tank):
        yield (
            "tank",
            f"The energy tank supplies the power of u from {law.signal.energy:g} J at the start; "
            "u = 0 while it is empty. Stability and margin hold while it is not empty.",
        )
    if len(law.levels(system.robot)) > 2:
        yield (
            "lower_tasks",
            "A lower task's error is projected into the null space of the tasks above."
            if law.task_error is TaskError.CONSISTENT
            else "Lower tasks feed back their full errors, as printed.",
        )
    if system.robot.floating_base:
        yield (
            "base_motion",
            "The passive bound assumes that base motions that the motors do not determine are at "
            "rest; the local margin includes them.",
        )
    if system.walking is not None:
        yield (
            "walking",
            "The law of [walking] (feet, steps, friction, terrain, gait, options) is a different "
            "one and is not certified.",
        )


def _of_drives(system: Design) -> Iterator[tuple[str, str]]:
    drives, robot = system.actuators, system.robot
    limited = np.isfinite(drives.torque_limit)
    if limited.any():
        yield (
            "torque_limit",
            "The motors' torque limits (torque_limit, or the URDF's effort) carry the posture and "
            "are not reached in motion.",
        )
    if np.isfinite(drives.velocity_limit).any():
        yield (
            "velocity_limit",
            "The motors' speed limits (velocity_limit, or the URDF's velocity) are not reached.",
        )
    if drives.coulomb_friction.any():
        yield (
            "coulomb_friction",
            "Coulomb friction (coulomb_friction, or the URDF's friction, taken at the motor) only "
            "dissipates; it leaves a static error, and the local margin assumes sliding motors.",
        )
    if (robot.damping > 0.0).any():
        yield (
            "joint_damping",
            "The URDF's joint damping acts at the links: stability and margin rely on it, the "
            "passive bound does not.",
        )
    left_out = [
        name
        for name, stated, used in (
            ("effort", robot.effort_limit, drives.torque_limit),
            ("velocity", robot.velocity_limit, drives.velocity_limit),
        )
        if (np.isfinite(stated) & (stated > 0.0) & np.isinf(used)).any()
    ]
    if (robot.friction > 0.0).any() and not drives.coulomb_friction.any():
        left_out.append("friction")
    if left_out:
        yield (
            "urdf_left_out",
            f"The URDF's {', '.join(left_out)} is not used; Actuators.of_robot uses it.",
        )
    if robot.remarks:
        yield "urdf_reading", " ".join(robot.remarks)
    if (robot.effort_limit == 0.0).any() or (robot.velocity_limit == 0.0).any():
        zero = (robot.effort_limit == 0.0) | (robot.velocity_limit == 0.0)
        names = ", ".join(np.array(robot.joints)[zero].tolist())
        yield "urdf_limit_zero", f"The URDF gives an effort or velocity limit of 0 for {names}."


def _of_contacts(system: Design) -> Iterator[tuple[str, str]]:
    if system.contacts:
        yield "contacts", "Contacts neither slip nor lift off."
    yield (
        "simulation",
        "[simulation] changes a run, not the loop: scenario, duration_s, physics_step_ms, "
        "log_period_ms, model_period_ms (bound and margin update J* and S at every tick), seed, "
        "pushes (frame, force_n, start_s, duration_s), drop_height, "
        "track_amplitude, track_frequency_hz, and of the feet friction, foot_radius, "
        "foot_half_length, foot_half_width, torsional_damping and torsional_radius.",
    )
