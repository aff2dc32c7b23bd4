"""Designs as models of other simulators: MuJoCo."""

from sealag.export._mujoco import MujocoModel

__all__ = ["MujocoModel"]
