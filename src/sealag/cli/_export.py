"""`sealag export`: a design as the model of another simulator."""

from pathlib import Path

from sealag import design
from sealag.cli._commands import compile_kernels
from sealag.cli._json import show_json
from sealag.cli._terminal import show
from sealag.errors import InputError
from sealag.export import MujocoModel
from sealag.files import Draft, check_output, write_text
from sealag.units import seconds_from_ms, time_text

TARGET = "mujoco"


def export_project(
    project: str, target: str, *, step_ms: float | None, out: Path | None, as_json: bool
) -> None:
    """Write the model and show its delays."""
    if target != TARGET:
        raise InputError(f"--for is {target!r}; it must be {TARGET}.")
    system = design.load(project)
    path = out or Path(f"{system.name}.xml")
    check_output(path, *system.files)
    with Draft(path) as draft:
        compile_kernels()
        step = None if step_ms is None else seconds_from_ms(step_ms)
        model = MujocoModel.of(system, step=step)
        write_text(draft, model.text)
    if as_json:
        show_json({"file": str(path), **model.summary(), "design_s": system.delays.d_1})
    else:
        _show(model, system.delays.d_1, path)


def _show(model: MujocoModel, bound: float, path: Path) -> None:
    steps = model.steps
    hold = f"{time_text(steps.hold)}, write ctrl every {_counted(steps.tick)}"
    rows = [
        ("time step", time_text(steps.step)),
        ("measurement", f"{time_text(steps.measurement_delay)}, {_counted(steps.measurement)}"),
        ("command", f"{time_text(steps.command_delay)}, {_counted(steps.command)}"),
        ("hold", hold),
        ("all together", time_text(steps.total)),
        ("delay of the design", time_text(bound)),
        ("model", str(path)),
    ]
    for name, value in rows:
        show(f"{name:26} {value}")
    for what in model.left_out:
        show(f"left out: {what}")


def _counted(steps: int) -> str:
    return "step" if steps == 1 else f"{steps} steps"
