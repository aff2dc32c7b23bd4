"""The command line: options, exit statuses, messages. Commands import what they use."""

from pathlib import Path
from typing import Annotated, Unpack

import typer

from sealag.cli._app_gains import sweep, tune
from sealag.cli._options import Columns, Json, MotionFile, Project, Quaternion, Shown, shown
from sealag.cli._terminal import show
from sealag.version import __version__

app = typer.Typer(
    name="sealag",
    help="How much network delay a robot with springs in its joints tolerates.",
    epilog="Exit status: 0 yes or done, 1 no (not certified, passive only, fell, certificate does "
    "not hold), 2 wrong input or an answer that cannot be written, 3 failed, 130 interrupted.",
    context_settings={"help_option_names": ["-h", "--help"]},
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def _show_version(asked: bool) -> None:
    if asked:
        show(f"sealag {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", is_eager=True, callback=_show_version, help="Show the version."),
    ] = False,
) -> None:
    """Options of the program itself."""


@app.command()
def init(
    urdf: Annotated[
        str,
        typer.Argument(
            help="The robot's URDF, xacro or MJCF file: a path, bundled:hume.urdf, "
            "package://PACKAGE/PATH, or example-robot-data:PATH of that package."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Project file to write; its folder is made if needed. Default: ROBOT.toml.",
        ),
    ] = None,
    base: Annotated[
        str,
        typer.Option(
            "--base", help="floating, fixed, or auto: a robot with legs floats, another is fixed."
        ),
    ] = "auto",
) -> None:
    """Write a commented project file with the robot's own joints and feet in it.

    Joints that cannot have an actuator are behind a #, each with its reason.

    The posture is a group state of an SRDF in the URDF's folder, or in a folder srdf there or
    beside it, whose name begins with standing, half_sitting, homing, home, default or neutral.
    Without one a robot with legs stands with bent knees, its centre of mass between its feet.
    """
    from sealag.cli._commands import init_project

    path = init_project(urdf, out, base=base)
    show(f"Wrote {path}; replace each FILL in it, then run: sealag certify {path}")


@app.command()
@shown
def certify(
    project: Project,
    motion: MotionFile = None,
    columns: Columns = None,
    quaternion: Quaternion = None,
    criterion: Annotated[
        str | None,
        typer.Option("--criterion", help="certified or published. Default: the project's."),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Certificate to write; its folder is made if needed. Default: "
            "PROJECT.certificate.json.",
        ),
    ] = None,
    time_varying: Annotated[
        bool,
        typer.Option(
            "--time-varying", help="Also bound matrices that vary in polytopes around the motion."
        ),
    ] = False,
    proofs: Annotated[
        str,
        typer.Option(
            "--proofs",
            help="How many instants are proven in the certificate, smallest bounds first; or all.",
        ),
    ] = "12",
    allow_unstable: Annotated[
        bool,
        typer.Option(
            "--allow-unstable",
            help="Status 0 also for a design that is passive only: you stabilise it by other "
            "means.",
        ),
    ] = False,
    **how: Unpack[Shown],
) -> None:
    """Bound the delay at every instant of a motion; status 1 unless passive at it and stable."""
    from sealag.cli._certify import Reading, certify_project

    raise typer.Exit(
        certify_project(
            project,
            motion,
            reading=Reading(columns=columns, quaternion=quaternion),
            criterion=criterion,
            time_varying=time_varying,
            proofs=proofs,
            out=out,
            allow_unstable=allow_unstable,
            **how,
        )
    )


@app.command()
@shown
def margin(
    project: Project,
    motion: MotionFile = None,
    columns: Columns = None,
    quaternion: Quaternion = None,
    horizon_ms: Annotated[
        float | None,
        typer.Option("--horizon-ms", help="List ranges of stable delays up to this one."),
    ] = None,
    rate_sweep: Annotated[
        bool,
        typer.Option(
            "--rate-sweep", help="Show what each sample rate of the controller tolerates instead."
        ),
    ] = False,
    **how: Unpack[Shown],
) -> None:
    """Compute the exact local delay margin of the frozen closed loop, along a motion."""
    from sealag.cli._commands import margin_project

    margin_project(
        project,
        motion,
        columns=columns,
        quaternion=quaternion,
        horizon_ms=horizon_ms,
        rate_sweep=rate_sweep,
        **how,
    )


app.command()(tune)
app.command()(sweep)


@app.command()
def verify(
    certificate: Annotated[Path, typer.Argument(help="Certificate file.")],
    exact: Annotated[bool, typer.Option("--exact", help="Check in rational arithmetic.")] = False,
    second: Annotated[
        bool,
        typer.Option(
            "--second",
            help="Run the second verifier instead: one file of the standard library, exact.",
        ),
    ] = False,
    project: Annotated[
        str | None,
        typer.Option(
            "--project",
            help="Compute matrices, bounds and delay again from this project, and compare.",
        ),
    ] = None,
    motion: Annotated[
        Path | None,
        typer.Option("--motion", help="Motion that was certified; needs --project."),
    ] = None,
    columns: Columns = None,
    quaternion: Quaternion = None,
    as_json: Json = False,
) -> None:
    """Check a certificate from its own numbers, or against its project; status 1 if it fails."""
    from sealag.cli._commands import verify_certificate

    raise typer.Exit(
        verify_certificate(
            certificate,
            exact=exact,
            second=second,
            project=project,
            motion=motion,
            columns=columns,
            quaternion=quaternion,
            as_json=as_json,
        )
    )


@app.command()
@shown
def simulate(
    project: Project,
    scenario: Annotated[
        str | None,
        typer.Option(
            "--scenario",
            help="regulate, track, drop, balance or walk. Default: simulation.scenario.",
        ),
    ] = None,
    duration: Annotated[
        float | None,
        typer.Option(
            "--duration",
            help="Seconds. Default: simulation.duration_s, or the length of the walk.",
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option("--seed", help="Seed of jitter and packet loss. Default: simulation.seed."),
    ] = None,
    delay_scale: Annotated[
        float, typer.Option("--delay-scale", help="Factor on both round trips.")
    ] = 1.0,
    log_ms: Annotated[
        float | None,
        typer.Option(
            "--log-ms",
            help="Time between two logged instants. Default: simulation.log_period_ms, or the "
            "controller's period.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            help="Recording to write; its folder is made if needed. Default: PROJECT.mcap.",
        ),
    ] = None,
    **how: Unpack[Shown],
) -> None:
    """Run the delayed robot, write a recording and its energy audit; status 1 if it falls."""
    from sealag.cli._simulate import simulate_project

    raise typer.Exit(
        simulate_project(
            project,
            scenario,
            duration=duration,
            seed=seed,
            delay_scale=delay_scale,
            log_ms=log_ms,
            out=out,
            **how,
        )
    )


@app.command()
def export(
    project: Project,
    target: Annotated[
        str, typer.Option("--for", help="Simulator to write for; there is mujoco.")
    ] = "mujoco",
    step_ms: Annotated[
        float | None,
        typer.Option(
            "--step-ms",
            help="Time step. Default: the longest that divides delays and period and that the "
            "springs allow, at most 1 ms.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", help="File to write; its folder is made if needed. Default: PROJECT.xml."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Write robot, springs, drives and delays for another simulator, so that delays are exact."""
    from sealag.cli._export import export_project

    export_project(project, target, step_ms=step_ms, out=out, as_json=as_json)


@app.command()
def paper(
    project: Annotated[
        str, typer.Argument(help="Project file of Hume with a [walking] section.")
    ] = "bundled:hume",
    out: Annotated[
        Path, typer.Option("--out", help="Folder for page and CSVs; it is made if needed.")
    ] = Path("out/paper"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Only a few cases of each table, in minutes.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Reproduce the paper's figures and check its claims one by one."""
    from sealag.cli._commands import write_paper

    write_paper(project, out, quick=quick, as_json=as_json)


@app.command()
def cite(as_json: Json = False) -> None:
    """Print BibTeX entries for sealag and for the paper that it reproduces."""
    from sealag.cli._cite import show_citations

    show_citations(as_json=as_json)
