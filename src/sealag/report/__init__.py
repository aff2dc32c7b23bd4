"""What a person looks at: self-contained HTML pages and MCAP recordings."""

from sealag.report._mcap import McapRecorder
from sealag.report._mcap_reader import RecordingFile, Signal, read_recording
from sealag.report._page import Cell, Figure, Raw, Section, Table, Text, render_page
from sealag.report._recording import write_run
from sealag.report._summary import run_summary

__all__ = [
    "Cell",
    "Figure",
    "McapRecorder",
    "Raw",
    "RecordingFile",
    "Section",
    "Signal",
    "Table",
    "Text",
    "read_recording",
    "render_page",
    "run_summary",
    "write_run",
]
