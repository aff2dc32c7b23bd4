"""`sealag tune`: gains for a delay, what stops them, and the project file that has them."""

from pathlib import Path
from typing import Any, TypedDict

from sealag import design
from sealag.cli._commands import busy, compile_kernels
from sealag.cli._json import show_json
from sealag.cli._pictures import check_picture, drawn, of_gains, show_picture
from sealag.cli._terminal import show
from sealag.design import System
from sealag.errors import FileError, InputError
from sealag.files import bundled, check_output, is_inside, write_text
from sealag.tune import tune
from sealag.units import number_of, seconds_from_ms, time_text

_SHARES_SHOWN = 3
_PROMISES = {
    "passive": "any passive robot and environment, every delay up to it",
    "jitter": "this robot beside its rest, every delay up to it that varies as it likes",
    "constant": "this robot beside its rest, every constant delay up to it; no jitter, no hold",
}
"""What holds for gains that reach the required delay by a number."""
_GOALS = {"bandwidth": "bandwidth", "damping-ratio": "damping_ratio"}
"""Names in --aim, and what `tune` calls them."""
_UNITS = {"bandwidth": "Hz", "rms": "Nm", "noise": "", "error": "", "torque": "Nm", "rate": ""}
"""Unit of each limit."""


class Outputs(TypedDict):
    """What becomes of the answer.

    Attributes:
        write: project file that gets the gains; None for none.
        pick: number of the front's point that counts; None for none.
        plot: picture; None for none.
        allow_unstable: whether passive gains count that hold no equilibrium.
        as_json: whether one JSON object is all that is printed.
    """

    write: Path | None
    pick: int | None
    plot: Path | None
    allow_unstable: bool
    as_json: bool


def tune_project(
    project: str,
    motion: Path | None,
    *,
    aim: str,
    limits: list[str],
    delay_ms: float | None,
    outputs: Outputs,
    **asked: Any,
) -> int:
    """Find gains, write them if that is asked for, and show them.

    Returns:
        0 if gains were found and certified, else 1.
    """
    word, goals = _aim(aim)
    allowed = dict(_limit(text) for text in limits)
    if len(allowed) < len(limits):
        raise InputError("--limit gives one quantity twice; give each once.")
    write, plot, pick = outputs["write"], outputs["plot"], outputs["pick"]
    if pick is not None and word != "front":
        raise InputError("--pick chooses a point of a front; ask for it with --aim front.")
    if word == "front" and write is not None and pick is None:
        raise InputError("A front has many designs; choose which to write with --pick NUMBER.")
    system = design.load(project)
    delay = None if delay_ms is None else seconds_from_ms(delay_ms)
    if write is not None:
        _check_target(write, system, motion, delay)
    if write is not None and word == "schedule":
        check_output(write.with_suffix(".schedule.csv"), *system.files, *filter(None, [motion]))
    check_picture(plot, *system.files, *([motion] if motion else []), beside=write)
    along = system.motion_of(motion)
    compile_kernels()
    with busy("tuning", along):
        tuned = tune(system, along, aim=word, limits=allowed, delay=delay, **goals, **asked)
        if pick is not None and tuned.front:
            tuned = tuned.pick(pick)
        good = tuned.found or (outputs["allow_unstable"] and tuned.passive_only)
        plot = plot if good else None
        if plot is not None:
            of_gains(tuned).write(plot)
    written = write if good else None
    if written is not None and tuned.schedule is not None:
        beside = written.with_suffix(".schedule.csv")
        system.save_motion(tuned.schedule, beside)
        write_text(written, tuned.text_with(beside.name))
    elif written is not None:
        write_text(written, tuned.system.text)
    if outputs["as_json"]:
        names = {"written": None if written is None else str(written)}
        show_json({**tuned.summary(), **names, **drawn(plot)})
    else:
        _show(tuned, written, good=good)
        show_picture(plot)
    return 0 if good else 1


def _aim(aim: str) -> tuple[str, dict[str, float]]:
    """The aim, and what --aim bandwidth=30,damping-ratio=0.7 gives of joint PD."""
    word, *parts = aim.split(",")
    word, given, text = word.partition("=")
    pairs = [("bandwidth", text)] if given else []
    pairs += [(name, text) for name, _, text in (part.partition("=") for part in parts)]
    goals = {_GOALS.get(name, name): number_of(text) for name, text in pairs}
    if not pairs:
        return word, {}
    if word != "bandwidth" or not set(goals) <= set(_GOALS.values()) or None in goals.values():
        raise InputError(
            f"--aim is {aim!r}; it must be one of stiffness, damping, drag, shaping, mapping, "
            "optimal, front, schedule, bandwidth or "
            "bandwidth=NUMBER "
            "(rad/s); damping-ratio=NUMBER may follow bandwidth behind a comma."
        )
    return word, {name: value for name, value in goals.items() if value is not None}


def _limit(text: str) -> tuple[str, float]:
    """A quantity and its limit: bandwidth=8Hz or rms=5Nm, with or without the unit."""
    name, _, number = text.partition("=")
    value = number_of(number.removesuffix(_UNITS.get(name, "")).strip())
    if name not in _UNITS or value is None:
        raise InputError(
            f"--limit is {text!r}; it must be bandwidth=NUMBER (Hz), rms=NUMBER (Nm), "
            "noise=NUMBER, error=NUMBER (m or rad), torque=NUMBER (Nm) or rate=NUMBER (1/s)."
        )
    return name, value


def _check_target(path: Path, system: System, motion: Path | None, delay: float | None) -> None:
    """Refuse to write where the gains would not be what was certified, or over another input."""
    own = system.files[0]
    others = [*system.files[1:], *([motion] if motion else [])]
    if path.resolve() == own.resolve():
        if is_inside(own.resolve(), bundled("hume", ending=".toml", what="project").parent):
            raise FileError(f"{own} came with sealag and is not changed; copy it first.")
    else:
        check_output(path, *system.files, *others)
        if path.resolve().parent != own.resolve().parent:
            raise FileError(
                f"{path} lies in another folder than {own}, where the project's relative paths "
                "start; choose a --write beside it."
            )
    if delay is not None and delay < system.delays.d_1:
        raise InputError(
            f"Gains for {time_text(delay)} are not written: the project's own delay of "
            f"{time_text(system.delays.d_1)} is longer; change [delays] first."
        )


def _show(tuned: Any, path: Path | None, *, good: bool) -> None:
    """Show gains, what stops them and by how much."""
    question, binding = tuned.question, tuned.binding
    rows = [
        (
            "tuned" if good else "not tuned",
            f"{question.aim} for the {question.number} number",
        ),
        ("delay of the design", time_text(question.system.delays.d_1)),
        ("required", time_text(question.required)),
        ("reached", time_text(tuned.reached_s)),
    ]
    if tuned.scale is not None:
        rows.append(("factor of all stiffness", f"{tuned.scale:.6g}"))
    if tuned.bandwidth_rad_s is not None:
        rows.append(("bandwidth", f"{tuned.bandwidth_rad_s:.6g} rad/s"))
    if len(tuned.factors) > 1:
        rows += [(f"  factor of {name}", f"{value:.6g}") for name, value in tuned.factors.items()]
    if binding is not None:
        rows += [(name, _gain(value)) for name, value in tuned.gains().items()]
    if good:
        rows.append(("promised", _PROMISES[question.number]))
        if tuned.schedule is not None:
            rows.append(("", "while the gains do not grow: growing, they add energy (docs, 16.9)"))
        rows += _transparency(tuned)
    if tuned.certificate is not None:
        status = tuned.certificate.answer.status.value.replace("_", " ")
        asked = "" if question.number == "passive" else " (of the passive number, not asked for)"
        rows.append(("certificate", status + asked))
    rows += _findings(tuned)
    if binding is not None:
        shares = sorted(binding.joints.items(), key=lambda item: -item[1])[:_SHARES_SHOWN]
        joints = ", ".join(f"{name} {share:.0%}" for name, share in shares if share >= 0.01)
        parts = ""
        if binding.spring_share:
            parts = (
                f" (spring {binding.spring_share:.0%}, delay {1.0 - binding.spring_share:.0%} of "
                "the compliance)"
            )
        rows.append(("stopped by", f"{binding.kind}{parts} at {joints}"))
        rows.append(("worst instant", f"{binding.instant}, at {binding.time_s:.3f} s"))
    if path is not None:
        rows.append(("written", str(path)))
    if tuned.front and binding is None:
        _show_front(tuned)
        return
    for name, value in rows:
        show(f"{name:26} {value}")
    for reason in tuned.reasons:
        show(f"{'passive only' if good else 'not tuned'} because {reason}")


def _findings(tuned: Any) -> list[tuple[str, str]]:
    """What a mapping of damping leaves, and what a quadratic index could be."""
    rows, mapping, index = [], tuned.mapping, tuned.index
    if tuned.schedule is not None:
        factors = tuned.schedule.stiffness
        rows.append(("factor along the motion", f"{factors.min():.6g} to {factors.max():.6g}"))
    if mapping is not None:
        error = f"{mapping.error:.2%} of the controller's damping, at most {mapping.worst:.2%}"
        rows.append(("left over", f"{error} at instant {mapping.instant}"))
        for name, value in mapping.jitter_s.items():
            rows.append((f"  jitter margin, {name}", time_text(value)))
    if index is not None:
        rows.append(("quadratic index", f"{index.value:.6g} s"))
        rows.append(("  without delay", f"{index.free:.6g} s"))
        rows.append(("  of any controller", f"{index.least:.6g} s at least, without delay"))
    return rows


def _show_front(tuned: Any) -> None:
    """Show the points of a front, one a line."""
    cost = "drag, J" if tuned.question.moves else "trace D, Nms/rad"
    show(f"{'number':>6} {'delay':>12} {'stiffness':>10} {cost:>17} {'bandwidth':>11}")
    for point in tuned.front:
        show(
            f"{point.number:6} {time_text(point.delay_s):>12} {point.scale:10.4g} "
            f"{point.cost:17.5g} {point.bandwidth_hz:8.4g} Hz"
        )
    show("--pick NUMBER certifies one of them, --write FILE writes it")


def _transparency(tuned: Any) -> list[tuple[str, str]]:
    """The least transparent joint by each quantity that has a limit."""
    shown = tuned.summary()["transparency"]
    rows = []
    for name, limit in tuned.question.limits.items():
        if name not in ("bandwidth", "rms"):
            continue
        unit, least = _UNITS[name], name == "bandwidth"
        values = shown[f"{name}_{unit.lower()}"]
        joint = (min if least else max)(values, key=values.get)
        row = f"{values[joint]:.6g} {unit} at {joint} (limit {limit:g} {unit})"
        rows.append((f"{name} of the torque", row))
    return rows


def _gain(values: dict[str, Any]) -> str:
    """Gains in one line: one number if all are alike."""
    if len({str(value) for value in values.values()}) == 1:
        return _text(next(iter(values.values())))
    return ", ".join(f"{name} {_text(value)}" for name, value in values.items())


def _text(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(_text(entry) for entry in value)}]"
    return f"{value:.6g}"
