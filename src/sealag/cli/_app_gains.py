"""The options of the commands that look for gains: tune and sweep."""

from pathlib import Path
from typing import Annotated, Unpack

import typer

from sealag.cli._options import Json, MotionFile, Plot, Project, ShownGains, shown


@shown
def tune(
    project: Project,
    motion: MotionFile = None,
    aim: Annotated[
        str,
        typer.Option(
            "--aim",
            help="stiffness: the largest; bandwidth: the largest of joint PD, or bandwidth=30 "
            "(rad/s), also with ,damping-ratio=0.7; damping: the least of the motors; drag: the "
            "least along the motion; shaping: the least beta for the embedded period; mapping: "
            "the controller's damping moved into the drives; optimal: the stiffness with the least "
            "quadratic index; front: designs that no other one beats.",
        ),
    ] = "stiffness",
    limit: Annotated[
        list[str] | None,
        typer.Option(
            "--limit",
            help="Transparency to keep: bandwidth=8Hz, the least of the locked joints; rms=5Nm, "
            "the largest of torque against command along the motion; noise=10, the "
            "largest gain of torque noise by shaping; error=0.02 and torque=30Nm, which count "
            "alike in the quadratic index. May be repeated.",
        ),
    ] = None,
    number: Annotated[
        str, typer.Option("--number", help="Delay that counts: passive, jitter or constant.")
    ] = "passive",
    share: Annotated[
        str, typer.Option("--share", help="One factor in common, or each task's or direction's.")
    ] = "common",
    delay_ms: Annotated[
        float | None, typer.Option("--delay-ms", help="Delay. Default: the design's own.")
    ] = None,
    safety: Annotated[float, typer.Option("--safety", help="Factor on the delay.")] = 1.0,
    write: Annotated[
        Path | None,
        typer.Option("--write", help="Project file that gets the gains: PROJECT, or one beside."),
    ] = None,
    **how: Unpack[ShownGains],
) -> None:
    """Find gains for a delay and what stops them; status 1 if there are none."""
    from sealag.cli._tune import Outputs, tune_project

    raise typer.Exit(
        tune_project(
            project,
            motion,
            aim=aim,
            number=number,
            share=share,
            delay_ms=delay_ms,
            safety=safety,
            limits=limit or [],
            outputs=Outputs(write=write, **how),
        )
    )


def sweep(
    project: Project,
    over: Annotated[
        list[str],
        typer.Option(
            "--over",
            help="What is swept: KEY=1,2,5 or KEY=LOW:HIGH:log40 (lin40, int), as often as there "
            "are keys. KEY is a dotted path in the project file, with places from 0 or names in "
            "lists: tasks.0.stiffness.",
        ),
    ],
    ask: Annotated[
        str,
        typer.Option(
            "--ask", help="certify, bound, margin, simulate, tune or tune:aim=…,number=…."
        ),
    ] = "certify",
    motion: MotionFile = None,
    sample: Annotated[
        str,
        typer.Option(
            "--sample",
            help="grid; lhs:POINTS or lhs:POINTS:SEED, a Latin hypercube; sobol likewise.",
        ),
    ] = "grid",
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Folder of the Parquet dataset; an unfinished sweep in it goes on. Default: "
            "PROJECT.sweep.",
        ),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option("--jobs", help="Processes. Default: one for each core.")
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            help="Address of a dask cluster to compute on instead, such as tcp://10.0.0.1:8786.",
        ),
    ] = None,
    plot: Plot = None,
    as_json: Json = False,
) -> None:
    """Ask many designs of a project, one row of a Parquet dataset each."""
    from sealag.cli._sweep import sweep_project

    raise typer.Exit(
        sweep_project(
            project,
            over,
            ask=ask,
            motion=motion,
            sample=sample,
            out=out,
            jobs=jobs,
            scheduler=scheduler,
            plot=plot,
            as_json=as_json,
        )
    )
