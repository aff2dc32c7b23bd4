"""What a person looks at: plots, self-contained HTML pages and MCAP recordings."""

from sealag.report._bounds_page import beyond_section, figure_5_section, limits_section
from sealag.report._mcap import McapRecorder, RecordingFile, Signal, read_recording
from sealag.report._page import Cell, Figure, Raw, Section, Table, Text, render_page
from sealag.report._paper_page import write_paper_page
from sealag.report._plots import (
    plot_delay_map,
    plot_figure_4,
    plot_gait,
    plot_torques,
    plot_walk_bounds,
)
from sealag.report._recording import write_run
from sealag.report._walk_page import (
    energy_section,
    means_section,
    playback,
    rows_table,
    walk_section,
)

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
    "beyond_section",
    "energy_section",
    "figure_5_section",
    "limits_section",
    "means_section",
    "playback",
    "plot_delay_map",
    "plot_figure_4",
    "plot_gait",
    "plot_torques",
    "plot_walk_bounds",
    "read_recording",
    "render_page",
    "rows_table",
    "walk_section",
    "write_paper_page",
    "write_run",
]
