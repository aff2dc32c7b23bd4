"""Options that several commands have."""

from pathlib import Path
from typing import Annotated

import typer

Project = Annotated[str, typer.Argument(help="Project file (TOML), or bundled:hume.")]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object and nothing else; errors too.")
]
MotionFile = Annotated[
    Path | None,
    typer.Option(
        "--motion",
        help="Motion to check: CSV, NPZ or Parquet with named columns, or a recording (MCAP). "
        "Default: the project's motion, else its posture.",
    ),
]
Columns = Annotated[
    str | None,
    typer.Option(
        "--columns",
        help="Names in the motion's file: theirs=ours,…, or a TOML or JSON file of it.",
    ),
]
Quaternion = Annotated[
    str | None,
    typer.Option(
        "--quaternion",
        help="Order of base_qx … base_qw: xyzw or wxyz. Default: xyzw, questioned.",
    ),
]
