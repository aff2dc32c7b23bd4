"""Pictures of answers: curves with units on their axes, which read the same in grey."""

import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from sealag.errors import InputError, either
from sealag.files import written_whole
from sealag.typing import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf", "html")

_STYLES = ("-", "--", "-.", ":", (0, (8, 2, 1, 2, 1, 2)), (0, (1, 3)))
_MARKERS = "osD^vx"
_GREYS = ("0.0", "0.35", "0.15", "0.45", "0.25", "0.5")
"""Curves differ by line, marker and grey; colours would not survive a printer."""
_MARKS = 12
"""Markers of a long curve."""
_FEW = 20.0
"""Ratio below which the ticks between decades have numbers."""
_DECADES = 100.0
"""Ratio of the largest to the smallest value from which on an axis is logarithmic."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A curve with a name.

    Attributes:
        name: in the legend.
        x: (N,) in the unit of the picture's axis.
        y: (N,) likewise; what is not finite leaves a gap.
        labels: a word beside each point; none if empty.
        shades: (N,) of a third quantity, the grey of each point; None for none.
        steps: whether a value holds until the next one.
    """

    name: str
    x: Array
    y: Array
    labels: tuple[str, ...] = ()
    shades: Array | None = None
    steps: bool = False

    def draw(
        self, at: Any, line: Any, marker: str, grey: str, *, span: tuple[float, float] | None
    ) -> Any:
        """Draw it.

        Args:
            at: axes.
            line: its line style.
            marker: its marker.
            grey: its grey.
            span: of the third quantity over all curves.

        Returns:
            What a bar of greys belongs to; None without one.
        """
        y = np.where(np.isfinite(self.y), self.y, np.nan)
        at.plot(
            self.x, y, linestyle=line, color=grey, linewidth=1.3, label=self.name or "_",
            marker=marker, markersize=5.0, markerfacecolor="white",
            markevery=1 if self.labels else max(1, -(-len(y) // _MARKS)),
            drawstyle="steps-post" if self.steps else "default",
        )  # fmt: skip
        for x, height, word in zip(self.x, y, self.labels):
            if np.isfinite(height):
                at.annotate(word, (x, height), (3, 4), textcoords="offset points", fontsize=6)
        if self.shades is None or span is None:
            return None
        return at.scatter(
            self.x, y, c=self.shades, cmap="gray", marker=marker, edgecolors=grey, s=26, zorder=3,
            vmin=span[0], vmax=span[1],
        )  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """Curves over one pair of axes.

    Attributes:
        title: above.
        x: name and unit of the lower axis.
        y: of the left one.
        curves: what is drawn; the first on top.
        levels: values of y with a name, drawn as thin lines across.
        marks: values of x likewise.
        shade: name and unit of the points' third quantity; empty for none.
        logarithmic: whether x is; y is where its values are positive and span two decades.
    """

    title: str
    x: str
    y: str
    curves: tuple[Curve, ...]
    levels: Mapping[str, float] = field(default_factory=dict)
    marks: Mapping[str, float] = field(default_factory=dict)
    shade: str = ""
    logarithmic: bool = False

    def write(self, path: Path) -> None:
        """Draw it into a file.

        Args:
            path: PNG, SVG, PDF or HTML.

        Raises:
            InputError: the ending is none of these.
            FileError: the file cannot be written.
        """
        figure, at = blank()
        shades = [curve.shades for curve in self.curves if curve.shades is not None]
        span = (np.concatenate(shades).min(), np.concatenate(shades).max()) if shades else None
        points = None
        for curve, style in zip(self.curves, self._styles()):
            points = curve.draw(at, *style, span=span) or points
        thin = cycle(_STYLES[1:])
        for draw, unit, values in (
            (at.axhline, self.y, self.levels), (at.axvline, self.x, self.marks)
        ):  # fmt: skip
            for name, value in values.items():
                if np.isfinite(value):
                    label = f"{name}: {value:.5g} {unit[unit.rfind('(') + 1 : -1]}"
                    draw(value, color="0.55", linewidth=0.9, linestyle=next(thin), label=label)
        at.set(title=self.title, xlabel=self.x, ylabel=self.y)
        if self.logarithmic:
            _logarithmic(at.xaxis)
        if self._wide():
            _logarithmic(at.yaxis)
        at.grid(color="0.9")
        if at.get_legend_handles_labels()[1]:
            at.legend(fontsize=8)
        if points is not None:
            figure.colorbar(points, ax=at, label=self.shade)
        save(figure, path, title=self.title)

    @staticmethod
    def _styles() -> Iterator[tuple[Any, str, str]]:
        """Line, marker and grey of each curve."""
        return zip(cycle(_STYLES), cycle(_MARKERS), cycle(_GREYS))

    def _wide(self) -> bool:
        """Whether the values of y are positive and span two decades."""
        values = np.concatenate([curve.y for curve in self.curves])
        values = values[np.isfinite(values)]
        return bool(len(values) and values.min() > 0.0) and values.max() > _DECADES * values.min()


def _logarithmic(axis: Any) -> None:
    """Make an axis logarithmic, with plain numbers at its ticks."""
    axis.axes.set(**{f"{axis.axis_name}scale": "log"})
    low, high = axis.get_view_interval()
    axis.set_major_formatter(lambda value, _: f"{value:g}")
    if high < _FEW * low:
        axis.set_minor_formatter(lambda value, _: f"{value:g}")
        axis.set_tick_params(which="minor", labelsize=8)


def ending_of(path: Path) -> str:
    """Return a picture's format.

    Args:
        path: the file.

    Raises:
        InputError: its ending is none of the formats'.
    """
    ending = path.suffix.removeprefix(".").lower()
    if ending not in FORMATS:
        raise InputError(f"--plot is {str(path)!r}; its ending must be {either(FORMATS)}.")
    return ending


def blank() -> tuple["Figure", Any]:
    """Return an empty figure of the size that all pictures have, and its axes."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 5.0), layout="constrained")
    return figure, figure.add_subplot()


def save(figure: "Figure", path: Path, *, title: str) -> None:
    """Write a figure; the same one gives the same bytes.

    Args:
        figure: what is drawn.
        path: PNG, SVG, PDF or HTML.
        title: of an HTML page, and what the names inside an SVG are made from.

    Raises:
        InputError: the ending is none of these.
        FileError: the file cannot be written.
    """
    import html

    import matplotlib

    ending = ending_of(path)
    kind = "svg" if ending == "html" else ending
    drawn = io.BytesIO()
    with matplotlib.rc_context({"svg.hashsalt": title, "svg.fonttype": "none"}):
        date = {} if kind == "png" else {"CreationDate" if kind == "pdf" else "Date": None}
        figure.savefig(drawn, format=kind, metadata=date, dpi=150)
    content = drawn.getvalue()
    if ending == "html":
        picture = content[content.index(b"<svg") :]
        name = html.escape(title).encode()
        head = b'<!doctype html><html lang="en"><meta charset="utf-8"><title>'
        content = head + name + b"</title><body>" + picture + b"</body></html>\n"
    with written_whole(path) as file:
        file.write(content)


__all__ = ["FORMATS", "Curve", "Picture", "blank", "ending_of", "save"]
