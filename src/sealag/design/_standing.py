"""Whether a design stands: what its contacts and its centre of mass say before any certificate."""

from collections.abc import Iterator, Sequence

import numpy as np

from sealag.design._design import Design
from sealag.robot import Contact, ContactKind, Motion
from sealag.typing import Array

_APART = 0.01  # m: soles and toes of one posture differ by less, a lifted foot by more
_OUTSIDE = 0.005  # m: what rounding and the radius of a foot explain
_DIRECTIONS = 720  # in which the support is looked at: distances are right to 1e-5 of themselves
_LOOKED_AT = 2000  # instants of a motion: each costs 20 us, and feet slip or step for longer
_CORNERS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])


def standing_warnings(design: Design, motion: Motion | None) -> tuple[str, ...]:
    """Return what keeps a floating-base robot from standing as its design says.

    A certificate holds for the contacts that the design states, wherever they are; these sentences
    say where that is not what a person would mean. One instant is a posture. Along more, feet may
    stand on steps and the centre of mass may be anywhere: contacts that are missing altogether are
    told, and those that move while they hold.

    Args:
        design: the robot, its contacts and its posture.
        motion: what is certified; the posture if None.
    """
    if not design.robot.floating_base:
        return ()
    motion = motion or design.still()
    if not any(motion.contact_sets):
        return (
            f"{design.robot.name} flies: its base is floating and nothing holds it to the ground, "
            "so that all of this is about free fall; give [[contacts]], or base = \"fixed\" in "
            "[robot] for a robot that is held",
        )  # fmt: skip
    if len(motion) > 1:
        return tuple(_of_motion(design, motion))
    contacts = motion.contact_sets[motion.contact_index[0]]
    return tuple(_of_posture(design, motion.q[0], contacts)) if contacts else ()


def _of_posture(design: Design, q: Array, contacts: Sequence[Contact]) -> Iterator[str]:
    robot = design.robot
    placed = [robot.frame_placement(contact.frame, q) for contact in contacts]
    heights = np.array([position[2] for _, position in placed])
    level = np.sort(heights)[(len(heights) - 1) // 2]
    for contact, over in zip(contacts, (heights - level).tolist(), strict=True):
        if abs(over) > _APART:
            where = "above" if over > 0.0 else "below"
            yield (
                f"contact {contact.frame} is {abs(over):.3f} m {where} the other feet, and held "
                "there all the same; correct the posture, or leave it out of [[contacts]]"
            )
    com = robot.center_of_mass(q)
    outside = _distance(com[:2], _support(design, contacts, placed))
    if outside > _OUTSIDE:
        yield (
            f"the centre of mass is {outside:.3f} m outside the feet, at x = {com[0]:.3f} m and "
            f"y = {com[1]:.3f} m: no robot that stands freely is in balance there; correct the "
            "posture or [[contacts]]"
        )


def _of_motion(design: Design, motion: Motion) -> Iterator[str]:
    """Contacts that are elsewhere than where they began to hold, by more than `_APART`."""
    at = np.unique(np.linspace(0, len(motion) - 1, _LOOKED_AT).astype(int))
    for contact in dict.fromkeys(held for some in motion.contact_sets for held in some):
        holds = np.array([contact in some for some in motion.contact_sets])[motion.contact_index]
        stretch = np.cumsum(~holds)[at]  # the same for two instants only if it holds in between
        began, began_in, farthest, when = np.zeros(3), -1, 0.0, 0.0
        for instant, number in zip(at[holds[at]], stretch[holds[at]], strict=True):
            position = design.robot.frame_placement(contact.frame, motion.q[instant])[1]
            if number != began_in:
                began, began_in = position, number
            moved = float(np.linalg.norm(position - began))
            if moved > farthest:
                farthest, when = moved, float(motion.time[instant])
        if farthest > _APART:
            yield (
                f"contact {contact.frame} holds at {when:.3f} s, but is {farthest:.3f} m from "
                f"where it began to hold: give contact:{contact.frame} with 0 where it is lifted, "
                "or correct the base's pose"
            )


def _support(
    design: Design, contacts: Sequence[Contact], placed: list[tuple[Array, Array]]
) -> Array:
    """Points (k, 2) whose hull the feet cover, m."""
    setting, points = design.simulation, []
    half = _CORNERS * [setting.foot_half_length, setting.foot_half_width]
    for contact, (rotation, position) in zip(contacts, placed, strict=True):
        if contact.kind is ContactKind.SURFACE:
            points.append(position[:2] + half @ rotation[:2, :2].T)
        else:
            points.append(position[None, :2])
    return np.concatenate(points)


def _distance(point: Array, hull: Array) -> float:
    """Distance (m) of a point from the convex hull of others; 0 or less inside: the largest over
    all directions u of u · point − max u · hull."""
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    u = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return float((u @ point - (u @ hull.T).max(axis=1)).max())
