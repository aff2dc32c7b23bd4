"""A picture of a sweep: a curve, a heat map, or parallel coordinates."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from sealag.picture import blank, save
from sealag.sweep._axis import Axis, Choices, Spacing
from sealag.sweep._dataset import Dataset
from sealag.sweep._question import Question
from sealag.sweep._sample import Kind, Sample
from sealag.typing import Array

_MOST_LINES = 2000
"""Lines of parallel coordinates; more are one dark surface."""
_COLOURS = "viridis"
"""Its lightness grows with the value, so that it reads the same in grey."""
_GOOD = {"certified", "completed", "True"}
"""Verdicts of points that are not crossed out."""
_UNITS = {
    "_ms": "ms",
    "_rad_s": "rad/s",
    "_hz": "Hz",
    "_nm": "Nm",
    "_s": "s",
    "_n": "N",
    "_m": "m",
    "_j": "J",
    "_rad": "rad",
    "spring_stiffness": "Nm/rad",
    "motor_damping": "Nms/rad",
    "rotor_inertia": "kg m²",
    ".kp": "Nm/rad",
    ".kd": "Nms/rad",
    "inertia_shaping": "ratio",
}
_HEADLINES = {
    "max_delay_s": "largest delay, passive bound (ms)",
    "delay_s": "exact local margin (ms)",
    "limit": "limit of the gains (factor, rad/s, Nms/rad or J by the aim)",
    "deviation_rms": "rms deviation from the posture (rad or m)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class _Points:
    """What is drawn of N points.

    Attributes:
        axes: the keys that move.
        places: (N, k) their values; words by their place in the list.
        values: (N,) the number that counts; NaN where there is none.
        good: (N,) whether the verdict is a good one.
    """

    axes: tuple[Axis, ...]
    places: Array
    values: Array
    good: Array


def draw(dataset: Dataset, sample: Sample, question: Question, path: Path) -> None:
    """Draw a dataset into a file.

    Args:
        dataset: the dataset.
        sample: which points it has.
        question: what was asked.
        path: the picture.

    Raises:
        InputError: the file's ending is none of the formats'.
        FileError: the file cannot be written.
    """
    points = _points(dataset, sample, question)
    figure, at = blank()
    name = _HEADLINES[question.headline]
    match len(points.axes):
        case 1:
            _curve(at, points, name)
        case 2:
            _map(figure, at, points, name, grid=sample.kind is Kind.GRID)
        case _:
            _parallel(figure, at, points, name)
    save(figure, path, title=f"sealag sweep {dataset.fingerprint}")


def _points(dataset: Dataset, sample: Sample, question: Question) -> _Points:
    axes = tuple(axis for axis in sample.axes if axis.moves) or sample.axes[:1]
    places, values, good = [], [], []
    verdict = [question.verdict] if question.verdict else []
    for part in dataset.read([*(axis.key.text for axis in axes), question.headline, *verdict]):
        number = [np.nan if x is None else x for x in part[question.headline]]
        values.append(np.array(number, dtype=float))
        words = part[verdict[0]] if verdict else ["True"] * len(number)
        good.append(np.array([str(word) in _GOOD for word in words]))
        places.append(np.array([_places(axis, part[axis.key.text]) for axis in axes]).T)
    scale = 1e3 if question.headline.endswith("_s") else 1.0
    found = np.concatenate(values) * scale
    return _Points(
        axes=axes,
        places=np.concatenate(places),
        values=np.where(np.isfinite(found), found, np.nan),
        good=np.concatenate(good),
    )


def _places(axis: Axis, values: Sequence[Any]) -> list[float]:
    """Where values stand on their axis."""
    if isinstance(axis.values, Choices) and not _numeric(axis):
        return [float(axis.values.values.index(value)) for value in values]
    return [float(value) for value in values]


def _numeric(axis: Axis) -> bool:
    values = axis.values
    return not isinstance(values, Choices) or type(values.values[0]) in (int, float)


def _log(axis: Axis) -> bool:
    return not isinstance(axis.values, Choices) and axis.values.spacing is Spacing.LOG


def _label(axis: Axis) -> str:
    name = axis.key.text
    unit = next((unit for end, unit in _UNITS.items() if name.endswith(end)), "")
    return f"{name} ({unit})" if unit else name


def _prepare(axis: Axis, side: Any) -> None:
    """Label an axis of a picture, `at.xaxis` or `at.yaxis`."""
    side.set_label_text(_label(axis))
    if _log(axis):
        side.axes.set(**{f"{side.axis_name}scale": "log"})
    if isinstance(axis.values, Choices) and not _numeric(axis):
        words = [str(value) for value in axis.values.values]
        side.set_ticks(range(len(words)), words)


def _curve(at: Any, points: _Points, name: str) -> None:
    order = np.argsort(points.places[:, 0], kind="stable")
    x, y, good = points.places[order, 0], points.values[order], points.good[order]
    at.plot(x, y, color="0.3", linewidth=1.0)
    at.plot(x[good], y[good], "o", color="0.0", markersize=4, label="yes")
    at.plot(x[~good], y[~good], "o", color="0.0", markersize=4, mfc="white", label="no")
    _prepare(points.axes[0], at.xaxis)
    at.set_ylabel(name)
    at.grid(color="0.9")
    if not good.all():
        at.legend(title="verdict")


def _map(figure: Any, at: Any, points: _Points, name: str, *, grid: bool) -> None:
    x, y = points.places.T
    if grid:
        columns, rows = np.unique(x), np.unique(y)
        table = np.full((len(rows), len(columns)), np.nan)
        table[np.searchsorted(rows, y), np.searchsorted(columns, x)] = points.values
        shown = at.pcolormesh(columns, rows, table, cmap=_COLOURS, shading="nearest")
    else:
        shown = at.scatter(x, y, c=points.values, cmap=_COLOURS, s=14)
    bad = ~points.good | np.isnan(points.values)
    if bad.any():
        at.plot(x[bad], y[bad], "x", color="0.6", markersize=3, markeredgewidth=0.8)
        at.set_title("×: the verdict is no, or there is no finite number", fontsize=9)
    _prepare(points.axes[0], at.xaxis)
    _prepare(points.axes[1], at.yaxis)
    figure.colorbar(shown, ax=at, label=name)


def _parallel(figure: Any, at: Any, points: _Points, name: str) -> None:
    from matplotlib.collections import LineCollection

    chosen = np.flatnonzero(np.isfinite(points.values))
    if len(chosen) > _MOST_LINES:
        steps = np.linspace(0, len(chosen) - 1, _MOST_LINES).astype(int)
        at.set_title(f"{_MOST_LINES} of {len(chosen)} points", fontsize=9)
        chosen = chosen[steps]
    chosen = chosen[np.argsort(points.values[chosen], kind="stable")]
    columns = [
        np.log(points.places[:, k]) if _log(axis) else points.places[:, k]
        for k, axis in enumerate(points.axes)
    ]
    places = np.array(columns).T[chosen]
    if not len(places):
        at.set_title("no point has a finite number", fontsize=9)
        return
    low, high = places.min(axis=0), places.max(axis=0)
    heights = (places - low) / np.where(high > low, high - low, 1.0)
    across = np.broadcast_to(np.arange(len(points.axes)), heights.shape)
    lines = LineCollection(
        list(np.stack([across, heights], axis=2)), cmap=_COLOURS, linewidths=0.8, alpha=0.7
    )
    lines.set_array(points.values[chosen])
    at.add_collection(lines)
    for k, axis in enumerate(points.axes):
        at.axvline(k, color="0.5", linewidth=0.8)
        for height, value in ((-0.02, points.places[chosen, k].min()),
                              (1.02, points.places[chosen, k].max())):  # fmt: skip
            words = f"{value:.4g}" if _numeric(axis) else str(axis.values.step(int(value)))
            side = "top" if height < 0.0 else "bottom"
            at.text(k, height, words, ha="center", va=side, fontsize=8)
    at.set_xticks(range(len(points.axes)), [_label(axis) for axis in points.axes], rotation=20)
    at.tick_params(axis="x", pad=14)
    at.set(yticks=[], ylim=(-0.02, 1.08), xlim=(-0.3, len(points.axes) - 0.7))
    figure.colorbar(lines, ax=at, label=name)
