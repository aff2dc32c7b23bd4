"""Recordings of runs as MCAP files, written and read back."""

from sealag.report._mcap import McapRecorder
from sealag.report._mcap_reader import read_recording
from sealag.report._recording import write_run

__all__ = [
    "McapRecorder",
    "read_recording",
    "write_run",
]
