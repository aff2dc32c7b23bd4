"""Block diagrams of the paper's Figs. 1 to 3, redrawn as SVG in the page's own colours."""

from collections.abc import Sequence
from html import escape
from typing import NamedTuple

LINE = 19.0
"""Distance of two lines of text, px."""

NAME = ' class="name"'


class Point(NamedTuple):
    """A place in a drawing, px from its upper left corner."""

    x: float
    y: float


class Box(NamedTuple):
    """A block with lines of text in its middle.

    Attributes:
        x: left edge, px.
        y: upper edge, px.
        width: px.
        height: px.
        lines: what it says; the first line is its name.
    """

    x: float
    y: float
    width: float
    height: float
    lines: tuple[str, ...]


class Arrow(NamedTuple):
    """A signal from one place to the next.

    Attributes:
        path: its corners; the head is at the last one.
        label: what it carries, written at `at`.
        at: where the label's middle is.
    """

    path: tuple[Point, ...]
    label: str
    at: Point


def architecture() -> str:
    """Draw Fig. 1: the central controller, the drives and the robot, and the delays between."""
    return _drawing(
        760,
        300,
        boxes=[
            Box(20, 60, 190, 120, ("Centralised WBOSC", "Eqs. (11), (17)", "J*, Λ, K_x, ḡ")),
            Box(300, 60, 190, 120, ("Embedded SEA control", "Eq. (7)", "β, D_θ, torque feedback")),
            Box(
                580,
                60,
                160,
                120,
                ("Robot", "motors, springs, links", "Eqs. (4) to (6)", "contacts F_r"),
            ),
        ],
        arrows=[
            Arrow((Point(210, 100), Point(300, 100)), "Γ_osc, late T_H/2", Point(255, 48)),
            Arrow((Point(490, 100), Point(580, 100)), "Γ_m, late T_L/2", Point(535, 48)),
            Arrow((Point(580, 150), Point(490, 150)), "θ̇, Γ_sea", Point(535, 142)),
            Arrow(
                (Point(660, 180), Point(660, 245), Point(115, 245), Point(115, 180)),
                "θ (or q̄(θ), q), late (T_H + T_L)/2",
                Point(385, 237),
            ),
            Arrow((Point(115, 20), Point(115, 60)), "x_d(t)", Point(145, 30)),
        ],
    )


def layers() -> str:
    """Draw Fig. 2: what is evaluated how often."""
    rows = [
        ("Model update: J*, Λ, ḡ", "at every tick, or J*, Λ every model_period_ms"),
        ("Centralised controller (17)", "1 kHz here; sample_time_ms, hold included"),
        ("Channels T_H, T_L", "time-varying; jitter, loss and order may be given"),
        ("Embedded loop (7): torque, damping", "continuous here, or embedded_period_ms"),
        ("Motors, springs, links, contacts", "continuous: integrated, contacts at 1 ms"),
    ]
    boxes = [
        Box(30 + 26 * k, 12 + 62 * k, 700 - 52 * k, 50, (name, rate))
        for k, (name, rate) in enumerate(rows)
    ]
    return _drawing(760, 330, boxes=boxes, arrows=[])


def interconnection() -> str:
    """Draw Fig. 3: two passive subsystems in feedback."""
    return _drawing(
        760,
        270,
        boxes=[
            Box(
                240,
                20,
                300,
                76,
                ("Joint side: links and contacts", "S_j = V_1", "Γ_sea → q̇_j passive, (26)"),
            ),
            Box(
                200,
                160,
                380,
                92,
                (
                    "Controller side: drives, springs, WBOSC, delays",
                    "S_c = V_2 + V_3 + V_4",
                    "q̇_j → −Γ_sea passive if (29) holds",
                ),
            ),
        ],
        arrows=[
            Arrow(
                (Point(540, 58), Point(660, 58), Point(660, 206), Point(580, 206)),
                "q̇_j",
                Point(680, 136),
            ),
            Arrow(
                (Point(200, 206), Point(100, 206), Point(100, 58), Point(240, 58)),
                "Γ_sea",
                Point(70, 136),
            ),
        ],
    )


def _drawing(width: float, height: float, *, boxes: Sequence[Box], arrows: Sequence[Arrow]) -> str:
    marks = [_box(box) for box in boxes] + [_arrow(arrow) for arrow in arrows]
    return (
        f'<svg viewBox="0 0 {width:g} {height:g}" class="diagram" '
        'xmlns="http://www.w3.org/2000/svg">' + "".join(marks) + "</svg>"
    )


def _box(box: Box) -> str:
    middle = box.x + box.width / 2.0
    top = box.y + box.height / 2.0 - LINE * (len(box.lines) - 1) / 2.0 + 5.0
    lines = "".join(
        f'<text x="{middle:g}" y="{top + LINE * k:g}"{NAME if k == 0 else ""}>{escape(line)}</text>'
        for k, line in enumerate(box.lines)
    )
    return (
        f'<rect x="{box.x:g}" y="{box.y:g}" width="{box.width:g}" height="{box.height:g}" rx="4"/>'
        + lines
    )


def _arrow(arrow: Arrow) -> str:
    corners = " ".join(f"{p.x:g},{p.y:g}" for p in arrow.path)
    before, tip = arrow.path[-2:]
    along = Point(_sign(tip.x - before.x), _sign(tip.y - before.y))
    across = Point(-along.y, along.x)
    head = " ".join(
        f"{tip.x - 10.0 * along.x + side * across.x:g},{tip.y - 10.0 * along.y + side * across.y:g}"
        for side in (-5.0, 5.0)
    )
    return (
        f'<polyline points="{corners}"/><polygon points="{tip.x:g},{tip.y:g} {head}"/>'
        f'<text x="{arrow.at.x:g}" y="{arrow.at.y:g}">{escape(arrow.label)}</text>'
    )


def _sign(value: float) -> float:
    return (value > 0.0) - (value < 0.0)
