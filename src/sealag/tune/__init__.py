"""Gains for a delay: the largest stiffness or bandwidth, the least damping, and what stops them."""

from sealag.tune._tune import tune

__all__ = ["tune"]
