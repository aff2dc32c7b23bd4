"""Options that several commands have."""

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, TypedDict, get_args, get_type_hints

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
Plot = Annotated[
    Path | None,
    typer.Option("--plot", help="Picture of it: PNG, SVG, PDF or HTML."),
]


class Shown(TypedDict):
    """How an answer is shown, by commands that compute a curve.

    Attributes:
        plot: the picture; None for none.
        as_json: whether one JSON object is all that is printed.
    """

    plot: Plot
    as_json: Json


class ShownGains(Shown):
    """The same of gains.

    Attributes:
        pick: number of a front's point; None for none.
        allow_unstable: whether passive gains count that hold no equilibrium.
    """

    pick: Annotated[
        int | None,
        typer.Option("--pick", help="Point of --aim front that is certified and written."),
    ]
    allow_unstable: Annotated[
        bool,
        typer.Option(
            "--allow-unstable",
            help="Take gains that are passive only, as of a walk on point feet: you stabilise it "
            "by other means.",
        ),
    ]


_DEFAULTS = {"plot": None, "as_json": False, "pick": None, "allow_unstable": False}


def shown(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command whose last parameter is **how: Unpack[Shown] its options.

    Typer reads a signature, which has no place for a dictionary of options.

    Args:
        command: the command.
    """
    *kept, last = inspect.signature(command).parameters.values()
    (options,) = get_args(last.annotation)
    added = [
        inspect.Parameter(
            name, inspect.Parameter.KEYWORD_ONLY, default=_DEFAULTS[name], annotation=hint
        )
        for name, hint in get_type_hints(options, include_extras=True).items()
    ]

    @functools.wraps(command)
    def called(**given: object) -> None:
        command(**given)

    called.__signature__ = inspect.Signature([*kept, *added])  # type: ignore[attr-defined]
    return called
