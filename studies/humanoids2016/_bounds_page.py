"""The parts of the paper's page that compare the walk with bounds, Fig. 5 and future work."""

import numpy as np

from humanoids2016._figure5 import TorqueTrace
from humanoids2016._findings import Findings
from humanoids2016._page import Cell, Figure, Section, Table, Text
from humanoids2016._plots import plot_delay_map, plot_figure_4, plot_lag, plot_torques
from humanoids2016._walk_page import rows_table
from sealag.typing import Array


def limits_section(found: Findings) -> Section:
    """Compare bounds over the planned and the simulated walk, and both with what walks.

    Args:
        found: what the study computed.
    """
    planned, simulated, delays = found.figure, found.simulated, found.delays

    def ms(value: float) -> Cell:
        return Cell(text=f"{value * 1e3:.1f}", css="number")

    both = simulated.both_feet
    bounds = [
        [
            f"(29), one leg, D_θ[0] = {damping:g} Nms/rad",
            _smallest(planned.instants_delay_s[k]),
            _smallest(simulated.instants_delay_s[k][~both]),
            _smallest(simulated.instants_delay_s[k][both]),
        ]
        for k, damping in enumerate(planned.abduction_damping)
    ]
    for before, after in zip(planned.certified, simulated.certified, strict=True):
        name = f"certified, {before.signal}, {before.form.value}, gravity {before.gravity}"
        bounds.append(
            [
                name.replace("_", " "),
                _smallest(before.delay_s),
                _smallest(after.delay_s[~both]),
                _smallest(after.delay_s[both]),
            ]
        )
    return Section(
        anchor="limits",
        title="Bounds and what walks",
        blocks=[
            Table(
                title="Smallest bounds over the walk",
                columns=[
                    "Smallest bound at α = 1 (ms)", "planned walk", "simulated, one foot carries",
                    "simulated, both feet carry",
                ],
                rows=bounds,
                open=True,
                note=f"Both feet carry at {both.mean():.0%} of the simulated instants; the leg "
                "that carries more counts as the one leg. On two feet the same K_x is a larger "
                "stiffness in the joints.",
            ),
            Figure(
                svg=plot_figure_4(simulated),
                caption="Fig. 4 over the walk as simulated: largest delay (ms) against α. Dashed: "
                "the certified criterion with the symmetric stiffness.",
            ),
            Text(
                text=(
                    "The criterion bounds the delay up to which the position loop is passive. It "
                    "does not predict a fall: the walk depends on the prediction over the delay "
                    "and on foot placement. The delays are scaled until the robot falls, over "
                    f"{delays.terrains} held-out rough terrains. The controller knows the mean "
                    "delay of its command."
                )
            ),
            Figure(
                svg=plot_delay_map(delays),
                caption=f"What is walked over {found.walk.case.walking.steps} steps, against "
                "spring stiffness and largest total delay d_1 = T_H + T_L/2. Lines: bounds for the "
                "position loop with the paper's gains over the planned walk. Its exact margin is "
                "0, since a biped on one point foot is an inverted pendulum; dotted: the delay at "
                "which one more pair of roots becomes unstable.",
            ),
            Table(
                title="Walked and certified delays over spring stiffness",
                columns=[
                    "K (Nm/rad)", "a gait up to (ms)", "walked up to (ms)",
                    "certified, motor (ms)", "certified, q̄(θ) (ms)", "next crossing (ms)",
                ],
                rows=[
                    [Cell(text=f"{row[0]:g}", css="number"), *(ms(value) for value in row[1:])]
                    for row in zip(
                        delays.stiffness, delays.longest_gait, delays.longest_walked,
                        delays.certified_motor, delays.certified_static, delays.first_crossing,
                        strict=True,
                    )
                ],
                note="Largest d_1 up to which every ground was walked.",
            ),
            rows_table(found.gains, "Spring stiffness, α and β at the paper's delays"),
        ],
    )  # fmt: skip


def _smallest(delays: Array) -> Cell:
    """The smallest of some bounds, ms; refused where a condition fails at one of the instants."""
    least = float(delays.min(initial=np.inf))
    text = "–" if least == np.inf else "refused" if least <= 0.0 else f"{least * 1e3:.1f}"
    return Cell(text=text, css="number")


def figure_5_section(found: Findings) -> Section:
    """Show Fig. 5.

    Args:
        found: what the study computed.
    """
    traces, joints = found.traces, found.system.robot.joints
    shown = [t for t in traces if t.damping_scale == 1.0 and t.stiffness == traces[0].stiffness]
    rows = [
        [
            Cell(text=f"{t.stiffness:g}", css="number"),
            Cell(text=f"{t.damping_scale:g}", css="number"),
            Cell(text=f"{t.beta:g}", css="number"),
            *(_if_walked(t, f"{value:.1f}") for value in t.deviation[:3]),
            _if_walked(t, f"{t.raw_deviation.mean():.0f}"),
            _if_walked(t, f"{t.command_lag * 1e3:.1f}"),
            _if_walked(t, f"{t.torque_lag * 1e3:.1f}"),
            t.walk.gait.cause,
        ]
        for t in traces
    ]
    channel = traces[0].channel
    return Section(
        anchor="figure5",
        title="Fig. 5: command and spring torque",
        blocks=[
            Text(
                text=(
                    "Γ_osc is the task torque, delayed until its command acts at the motors; "
                    "Γ_sea is the spring torque. At α = 1 the command τ_osc consists mostly of the "
                    "feedforward D_θθ̇_d, which the embedded damping cancels. It masks the effect "
                    "of β."
                )
            ),
            Figure(
                svg=plot_lag(shown, joints.index("right_knee")),
                caption=f"Right knee at K = {shown[0].stiffness:g} Nm/rad, α = 1: Γ_osc as it is "
                "sent and Γ_sea, which lags by the delay, the springs and the motors.",
            ),
            Figure(
                svg=plot_torques(shown, range(3)),
                caption=f"One leg's joints at K = {shown[0].stiffness:g} Nm/rad, α = 1: Γ_osc "
                "(thin) and Γ_sea (thick) for the smallest and largest β.",
            ),
            Table(
                title="Deviation and lag of the spring torque",
                columns=[
                    "K (Nm/rad)", "α", "β", *(f"{name} (Nm)" for name in joints[:3]),
                    "τ_osc − Γ_sea (Nm)", "command late (ms)", "Γ_sea late (ms)", "walk",
                ],
                rows=rows,
                note="RMS of Γ_osc − Γ_sea for one leg's joints; mean RMS over all joints with "
                "the feedforward left in; measured lags of the acting command and of Γ_sea behind "
                f"what was sent, beside a mean (T_H + T_L)/2 of {channel * 1e3:.1f} ms.",
            ),
        ],
    )  # fmt: skip


def _if_walked(trace: TorqueTrace, text: str) -> Cell:
    return Cell(text=text if trace.walk.gait.walked else "–", css="number")


def beyond_section(found: Findings) -> Section:
    """Show walks beyond the paper, and what became of its future work.

    Args:
        found: what the study computed.
    """
    certificate = found.certificate

    answer, feedback = certificate.answer, certificate.question.feedback.replace("_", " ")

    def ms(value: float | None) -> str:
        return "nothing" if value is None else f"{value * 1e3:.2f} ms"

    return Section(
        anchor="beyond",
        title="Beyond the paper",
        blocks=[
            rows_table(found.beyond, "Stairs, rougher ground, pushes"),
            rows_table(found.drives, "Drives that are not ideal"),
            Text(
                text=(
                    "Coulomb friction only dissipates, so that the certified bound stays as it is. "
                    "A finite torque bandwidth is not certified: " + found.bandwidth_refusal
                )
            ),
            Table(
                title="The paper's future work",
                columns=["Future work", "Here"],
                rows=[
                    [
                        "(i) time-varying J*, Λ and stiffness",
                        "One constant multiplier for the whole planned walk, which V_4 needs, "
                        f"allows {ms(answer.common_multiplier_delay_s)}; arbitrarily "
                        "time-varying matrices inside polytopes around it, window by window, "
                        f"{ms(answer.time_varying_delay_s)}; the pointwise bound is "
                        f"{ms(answer.max_delay_s)} "
                        f"({feedback} feedback).",
                    ],
                    [
                        "(ii) asymmetric delays in feedforward and feedback",
                        "Each way has its own delay, jitter and loss in the project file. The "
                        "criterion depends on their sum d_1; the command's way alone is what the "
                        "walk predicts over.",
                    ],
                    [
                        "(iii) optimal central controller; central against embedded damping",
                        _central(found),
                    ],
                    [
                        "(iv) experiments; Coulomb friction and torque bandwidth",
                        "Both in the simulated walk, table above. No experiment on hardware.",
                    ],
                ],
                stack=True,
            ),
        ],
    )


def _central(found: Findings) -> str:
    """What it costs to compute the damping centrally."""
    whole = [row for row in found.damping if row.share == max(r.share for r in found.damping)]
    each = ", ".join(f"{row.joint} {row.constant_s * 1e3:.2f} ms" for row in whole)
    return (
        f"With all damping central the exact margin of a held joint is {each} (claim “central "
        "damping”). sealag tune --aim mapping moves such damping into the drives and says what is "
        "left over; --aim optimal finds the stiffness with the least quadratic index under the "
        "bound."
    )
