"""Recordings of runs as MCAP files."""

from sealag.report._mcap import McapRecorder
from sealag.report._mcap_reader import read_recording
from sealag.report._recording import write_run
from sealag.report._summary import run_summary

__all__ = [
    "McapRecorder",
    "read_recording",
    "run_summary",
    "write_run",
]
