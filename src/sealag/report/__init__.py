"""What a person looks at: plots, self-contained HTML pages and MCAP recordings."""

from sealag.report._mcap import McapRecorder, RecordingFile, Signal, read_recording
from sealag.report._page import Cell, Figure, Raw, Section, Table, Text, render_page, write_text

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
    "write_text",
]
