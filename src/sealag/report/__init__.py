"""Recordings of runs as MCAP files, and designs as models of MuJoCo."""

from sealag.report._mcap import McapRecorder
from sealag.report._mcap_reader import read_recording
from sealag.report._mujoco import MujocoModel
from sealag.report._recording import write_run

__all__ = [
    "McapRecorder",
    "MujocoModel",
    "read_recording",
    "write_run",
]
