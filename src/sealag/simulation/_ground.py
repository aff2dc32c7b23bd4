"""Feet, and the contact frame where they stand."""

import math
from dataclasses import dataclass

import numpy as np

from sealag.errors import InputError
from sealag.robot import Contact, ContactKind
from sealag.typing import Array
from sealag.walking import Ground


@dataclass(frozen=True, slots=True, kw_only=True)
class Foot:
    """A frame that can touch the ground.

    A POINT foot is a small sphere that pivots about its centre. A SURFACE foot is a rectangle in
    the frame's x-y plane whose four corners touch one by one, so that it tips when the centre of
    pressure reaches an edge.

    Attributes:
        contact: Frame and kind of the contact.
        friction: Coulomb coefficient; inf never slips.
        radius: Height of the frame (POINT) or of the sole's plane (SURFACE) above the ground when
            touching, m.
        half_length: Half the sole's length along the frame's x, m; SURFACE only.
        half_width: Half the sole's width along the frame's y, m; SURFACE only.
        torsional_damping: Friction torque about the normal per yaw rate, Nms/rad.
        torsional_radius: Largest such torque per normal force, m; the size of the patch.

    Raises:
        InputError: A value is negative or not a number, or a SURFACE foot has no size.
    """

    contact: Contact
    friction: float = 0.8
    radius: float = 0.0
    half_length: float = 0.0
    half_width: float = 0.0
    torsional_damping: float = 0.0
    torsional_radius: float = math.inf

    def __post_init__(self) -> None:
        for name in (
            "friction", "radius", "half_length", "half_width",
            "torsional_damping", "torsional_radius",
        ):  # fmt: skip
            value = getattr(self, name)
            if not value >= 0:
                raise InputError(f"foot {self.contact.frame}: {name} must be >= 0, got {value}")
        surface = self.contact.kind == ContactKind.SURFACE
        if surface and not (self.half_length > 0 and self.half_width > 0):
            raise InputError(
                f"foot {self.contact.frame}: a surface contact needs half_length and half_width > 0"
            )

    def offsets(self) -> Array:
        """Return the foot's contact points in its frame (1 or 4, 3), m."""
        if self.contact.kind == ContactKind.POINT:
            return np.zeros((1, 3))
        a, b = self.half_length, self.half_width
        return np.array([[a, b, 0.0], [a, -b, 0.0], [-a, b, 0.0], [-a, -b, 0.0]])


def contact_frame(ground: Ground, x: float, y: float) -> Array:
    """Return the contact frame at a point of the ground: rows tangent, tangent, normal (3, 3).

    The normal is ``ground.normal(x, y)`` where the ground has one, else from central
    differences of the height over 1 mm.

    Args:
        ground: The ground.
        x: World x, m.
        y: World y, m.
    """
    normal_of = getattr(ground, "normal", None)
    if normal_of is not None:
        normal = np.array(normal_of(x, y), dtype=float)
    else:
        d = 1e-3
        slope_x = (ground.height(x + d, y) - ground.height(x - d, y)) / (2 * d)
        slope_y = (ground.height(x, y + d) - ground.height(x, y - d)) / (2 * d)
        normal = np.array([-slope_x, -slope_y, 1.0])
    normal /= float(np.linalg.norm(normal))
    first = np.array([1.0, 0.0, 0.0]) - normal[0] * normal
    if np.linalg.norm(first) < 1e-6:
        first = np.array([0.0, 1.0, 0.0]) - normal[1] * normal
    first /= float(np.linalg.norm(first))
    return np.stack([first, np.cross(normal, first), normal])
