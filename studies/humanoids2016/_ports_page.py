"""The part of the paper's page that shows both subsystems at their ports, and the tank."""

from collections.abc import Sequence

from humanoids2016._findings import Findings
from humanoids2016._leg_loop import WILD
from humanoids2016._page import Cell, Section, Table, Text
from humanoids2016._ports import ENDLESS, PULL, THRESHOLDS, PortRow, TankRow


def ports_section(found: Findings) -> Section:
    """Show S_j and S_c at the paper's ports, and how long the tank lasts.

    Args:
        found: what the study computed.
    """
    return Section(
        anchor="ports",
        title="Each subsystem at its own port",
        blocks=[
            Text(
                text=(
                    "The stance leg, frozen where (29) is smallest, is pushed from rest for "
                    f"{found.ports[0].duration:g} s. Observed are S_j = V_1 at the port (Γ_sea, "
                    "q̇_j) and S_c = V_2 + V_3 + V_4 at (q̇_j, −Γ_sea), with E_s inside V_4 as in "
                    "the paper. A subsystem is passive if its storage never rises above its "
                    "supply between any two instants. Where ΛK_x is not symmetric V_3 does not "
                    "exist; then S_c holds half the task's symmetric part, and the last column "
                    "says what the port does anyway. A run ends where a motor is faster than "
                    f"{WILD:g} rad/s."
                )
            ),
            Table(
                title="Passivity of both subsystems at the paper's ports",
                columns=[
                    "Leg and what is fed back", "push", "d (ms)", "joint side", "controller's side",
                    "|θ̇| of its bound", "most given (J)",
                ],
                rows=[_port_row(row) for row in found.ports],
                note="S_c: largest rise above the supply, in J. Given: by the controller's side "
                "to the links.",
            ),
            Text(
                text=(
                    "The tank is that of (19) to (22), with v_1 and K_b = diag("
                    + ", ".join(f"{value:g}" for value in PULL)
                    + ") 1/s. E_s is integrated instead of s, which overshoots through 0. Only "
                    "the corrected flow keeps V from rising. Motion drains both: what lasts this "
                    "long need not last for ever."
                )
            ),
            Table(
                title="How long the energy tank lasts",
                columns=[
                    "flow", "push", "d (ms)", "E_s(0) (J)",
                    *(f"empty at, ε = {value:g} (s)" for value in THRESHOLDS),
                    "|x̂ − x| / |x|", "V rises by (J)",
                ],
                rows=_tank_rows(found.tanks),
                note="ε in J^½. Deviation and rise with the smaller ε; a rise below the "
                "error of the works is 0.",
            ),
        ],
    )  # fmt: skip


def _number(text: str) -> Cell:
    return Cell(text=text, css="number")


def _port_row(row: PortRow) -> list[Cell | str]:
    return [
        f"{row.leg}, {row.fed}" + ("" if row.potential else " (no V_3)"),
        row.push,
        _number(f"{row.delay_s * 1e3:.1f}"),
        _passive(row.joint_passive, row.joint_drop),
        _passive(row.controller_passive, row.controller_drop),
        _number(f"{row.fastest / row.speed_bound:.0%}" if row.bounded else "exceeded"),
        _number(f"{row.given:.3g}"),
    ]


def _passive(passive: bool, drop: float) -> Cell:
    if passive:
        return Cell(text="passive", css="verdict confirmed")
    given = f"{drop:.2g} J" if drop < ENDLESS else "without end"
    return Cell(text=f"active, {given}", css="verdict contradicted")


def _tank_rows(tanks: Sequence[TankRow]) -> list[list[Cell | str]]:
    rows = []
    for k in range(0, len(tanks), len(THRESHOLDS)):
        same = tanks[k : k + len(THRESHOLDS)]
        last = same[-1]
        rows.append([
            f"{last.flow}", last.push, _number(f"{last.delay_s * 1e3:.1f}"),
            _number(f"{last.energy:g}"),
            *(_number("never" if r.emptied is None else f"{r.emptied:.3f}") for r in same),
            _number(f"{last.astray:.1%}"),
            _number(f"{last.rise:.2g}" if last.rise > last.tolerance else "0"),
        ])  # fmt: skip
    return rows
