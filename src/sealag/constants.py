"""Physical constants that every room shares."""

GRAVITY = 9.81
"""m/s², along −z of the world; the value of Pinocchio's models."""

__all__ = [
    "GRAVITY",
]
