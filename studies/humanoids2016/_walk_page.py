"""The parts of the paper's page that show the walk."""

import json
from collections.abc import Sequence

import numpy as np

from humanoids2016._ablation import PUBLISHED_LAW
from humanoids2016._findings import Findings
from humanoids2016._page import Cell, Figure, Raw, Section, Table, Text
from humanoids2016._plots import plot_gait
from humanoids2016._printed_task import SWING_STIFFNESS
from humanoids2016._walk import Walk
from humanoids2016._walk_table import WalkRow
from sealag.delay import RoundTrip
from sealag.design import System
from sealag.typing import Array

FRAMES_PER_SECOND = 30.0


def walk_section(found: Findings) -> Section:
    """Show the walk: playback, gait against plan, success with errors.

    Args:
        found: what the study computed.
    """
    system, walk, held_out = found.system, found.walk, found.held_out
    walking, gait = walk.case.walking, walk.gait
    plan = walking.gait
    springs, damping = system.actuators.spring_stiffness, system.actuators.motor_damping
    return Section(
        anchor="walk",
        title="The walk, in closed loop",
        blocks=[
            Text(
                text=(
                    f"Hume walks on the simulator: springs of {_span(springs)} Nm/rad, D_θ of "
                    f"{_span(damping)} Nms/rad, T_H of {_delay(system.delays.central)} and T_L of "
                    f"{_delay(system.delays.embedded)}, unilateral contact with friction "
                    f"{walking.friction:g} and plastic impacts. No external wrench and no "
                    "prescribed base motion. It took "
                    f"{gait.steps} steps ({gait.cause}); after the second step its apex speeds "
                    f"stay within {gait.speed_deviation:.0%} of the planned "
                    f"{plan.apex_speed:g} m/s and its step widths within "
                    f"{gait.width_deviation:.0%} of {plan.step_width:g} m."
                )
            ),
            Raw(
                html=playback(system, walk),
                caption="Drag to turn; move over the curves to see an instant. Right leg blue, "
                "left leg orange and dashed; a ring marks a foot on the ground.",
            ),
            Figure(
                svg=plot_gait(walk),
                caption="Apex speed (m/s) and step width (m) at each step; the plan is dashed, "
                "the tolerance shaded (20 % and 25 %).",
            ),
            Text(
                text=(
                    f"Over random terrains of ± 5 cm, {walking.steps} steps each; a gait has "
                    "apex speeds within 20 % and step widths within 25 % of the plan after the "
                    "second step."
                )
            ),
            rows_table(found.robust, "Success with sensor and model errors"),
            Text(
                text=(
                    "Gains and gait were tuned on some of these terrains. On held-out terrains, "
                    f"{held_out[0].steps} steps each:"
                )
            ),
            rows_table(held_out, "The same on held-out terrains"),
        ],
    )


def _span(values: Array) -> str:
    low, high = float(values.min()), float(values.max())
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _delay(trip: RoundTrip) -> str:
    return f"{trip.mean * 1e3:g} ms in the mean and {trip.upper_bound * 1e3:g} ms at most"


def _why_it_falls(found: Findings) -> str:
    """Success of the published law, and the torque that its damping takes in the walk above."""
    run, damping = found.walk.run, found.system.actuators.motor_damping
    speeds = found.system.robot.joint_velocities(run.v)
    knee = next(k for k, name in enumerate(run.joints) if "knee" in name)
    rate = float(np.sqrt(np.mean(speeds[:, knee] ** 2)))
    carried = float(np.sqrt(np.mean(run.tau_sea[:, knee] ** 2)))
    printed = "; ".join(
        f"{row.name}: {row.walked} of {row.terrains} walk, {row.mean_steps:.1f} steps in the mean"
        for row in found.ablations
        if row.name.startswith(PUBLISHED_LAW)
    )
    return (
        f"The law as printed, {printed}. In the walk above the knee moves at {rate:.1f} rad/s "
        f"RMS. There plain damping D_θθ̇ with {damping[knee]:g} Nms/rad takes "
        f"{damping[knee] * rate:.0f} Nm; the springs carry {carried:.0f} Nm RMS. The printed law "
        "has no velocity feedforward to compensate the damping, and its swing leg lags."
    )


def _printed_text(found: Findings) -> str:
    """What the printed task is, and its gains."""
    drives = found.system.actuators
    right = [k for k, name in enumerate(found.system.robot.joints) if name.startswith("right")]
    damping = ", ".join(f"{drives.motor_damping[k]:g}" for k in right)
    return (
        "The walk above has tasks of its own. The paper's is the CoM's position and the torso's "
        "orientation, 6-D, with K_x = diag(100, 100, 100, 50, 50, 50) 1/s², D_θ = diag("
        f"{damping}) Nms/rad in each leg, ΛK_x and ḡ(θ) as printed, references and supports of the "
        "planned walk without preview. Nothing there moves the swing leg; where a row says so, its "
        f"foot follows the plan on a second level with {SWING_STIFFNESS:g} 1/s². Over the same "
        f"number of grounds as the rows above, {found.printed[0].terrains}:"
    )


def means_section(found: Findings) -> Section:
    """Show what each of the walking controller's means is worth.

    Args:
        found: what the study computed.
    """
    everywhere, ablations, gait = found.everywhere, found.ablations, found.gait
    cells = [
        [
            name,
            *(
                Cell(text=f"{walked} / {steady}", css="number")
                for walked, steady in zip(
                    everywhere.walked[k].tolist(), everywhere.gaits[k].tolist(), strict=True
                )
            ),
        ]
        for k, name in enumerate(everywhere.means)
    ]
    return Section(
        anchor="means",
        title="Ablation of the walking controller",
        blocks=[
            Text(
                text=(
                    "The walking law is not the plain delayed position feedback of Theorem 1: it "
                    "predicts the state over its delay with a model, damps θ̇ − θ̇_d instead of θ̇ "
                    "and adds a lead term. The bound of Theorem 1 does not cover it. One element "
                    "left out at a time:"
                )
            ),
            rows_table(ablations, "One element left out"),
            Text(text=_why_it_falls(found)),
            Text(text=_printed_text(found)),
            rows_table(found.printed, "The printed law on the printed task"),
            Table(
                title="Each element left out, over springs, α, β and delays",
                columns=["Left out", *everywhere.conditions],
                rows=cells,
                note=f"Walks without a fall / gaits, of {everywhere.terrains} rough grounds "
                "each; K in Nm/rad, 350 unless given.",
            ),
            Text(
                text=(
                    "A walk without a fall need not keep the planned gait: of the walks below, "
                    f"{sum(row.walked for row in gait)} of {sum(row.terrains for row in gait)} do "
                    f"not fall and {sum(row.gaits for row in gait)} are gaits. Prediction at "
                    "constant velocity neglects the torques in flight and the change of support. "
                    "Foot placement by the CoM velocity neglects the angular momentum of the "
                    "legs. Each error alone displaces the footstep:"
                )
            ),
            rows_table(gait, "What makes the walk a gait"),
        ],
    )


def energy_section(found: Findings) -> Section:
    """Show the walk's energy audit, and the passivity observer beside the certificate.

    Args:
        found: what the study computed.
    """
    audit, certificate = found.walk.run.audit, found.certificate
    flows, works = audit.joint_flows, audit.scalar_flows
    drive = (flows["command"] - flows["damping"]).sum(axis=1)
    port = flows["port"].sum(axis=1)
    observed, at_links = audit.joint_side, audit.joint_port
    lifted = float(audit.stores["gravity"][-1] - audit.stores["gravity"][0])
    impact = float(works["impact"][-1])

    def joule(value: float) -> Cell:
        return Cell(text=f"{value:.3g}", css="number")

    rows: list[list[str | Cell]] = [
        ["moved between the stores (throughput)", joule(float(audit.throughput[-1]))],
        ["largest error of the first law", joule(float(np.abs(audit.residual).max()))],
        ["lifted: gravity at the end less at the start",
         joule(lifted)],
        ["work of the motors", joule(float(flows["motor_work"][-1].sum()))],
        ["lost in impacts", joule(impact)],
        ["lost in sliding", joule(-float(works["sliding"][-1]))],
        ["net energy through the port (τ_osc − D_θθ̇, θ̇) from the controller",
         joule(float(drive[-1]))],
        ["most that the controller had given there at any instant", joule(float(drive.max()))],
        ["net energy through the paper's port (Γ_sea, q̇_j) to the links", joule(float(port[-1]))],
        ["most that had passed there at any instant", joule(float(port.max()))],
        ["most that links had given back there since an earlier instant",
         joule(float((np.maximum.accumulate(port) - port).max()))],
    ]  # fmt: skip
    question, answer = certificate.question, certificate.answer
    bound, verdict = answer.max_delay_s * 1e3, answer.status.value.replace("_", " ")
    return Section(
        anchor="energy",
        title="Energy of the walk",
        blocks=[
            Table(
                title="Energy over the walk",
                columns=["Energy", "J"],
                rows=rows,
                open=True,
                note=f"First law closed to {audit.closure:.1e} of the throughput.",
            ),
            Text(
                text=(
                    "Passivity observers: links and contacts, S_j = V_1 at the paper's port "
                    f"(Γ_sea, q̇_j), were {at_links.verdict}; with springs and motors, at (τ_osc − "
                    f"D_θθ̇, θ̇), {observed.verdict}. The walking law has no storage function: S_c "
                    f"does not exist. Its side delivered up to {port.max():.1f} J through the "
                    f"paper's port, the law up to {drive.max():.1f} J through its own, and is "
                    "passive only if it stores at least as much at the start. Lifting the robot "
                    f"took {lifted:.1f} J of it, impacts {impact:.2f} J. The certificate covers "
                    "the position loop of Theorem 1 only: "
                    f"{verdict}, d_1 up to {bound:.1f} ms against {question.delay_s * 1e3:.1f} "
                    f"ms, fed back {question.feedback.replace('_', ' ')}."
                )
            ),
        ],
    )


def rows_table(rows: Sequence[WalkRow], title: str) -> Table:
    """Tabulate success over terrains.

    Args:
        rows: one for each case.
        title: what was varied.
    """

    def percent(value: float) -> Cell:
        return Cell(text=f"{value:.0%}" if np.isfinite(value) else "–", css="number")

    return Table(
        title=title,
        columns=["Case", "walked", "gaits", "speed off by", "width off by", "mean steps", "falls"],
        rows=[
            [
                row.name,
                Cell(text=f"{row.walked} of {row.terrains}", css="number"),
                Cell(text=f"{row.gaits} of {row.terrains}", css="number"),
                percent(row.speed_deviation),
                percent(row.width_deviation),
                Cell(text=f"{row.mean_steps:.1f}", css="number"),
                row.causes[0] if row.causes else "none",
            ]
            for row in rows
        ],
        note="Largest deviations over the walks that did not fall; the first fall's cause.",
    )


def playback(system: System, walk: Walk) -> str:
    """Return markup and script that play a walk in 3-D, without any library.

    Args:
        system: Hume and its delays.
        walk: the walk.
    """
    import jinja2
    from markupsafe import Markup

    run, robot = walk.run, system.robot
    sides = ("left", "right")
    knees = [run.joints.index(f"{side}_knee") for side in sides]
    feet = [list(run.feet).index(f"{side}_foot") for side in sides]
    delay = system.delays.central.at(run.time) + 0.5 * system.delays.embedded.at(run.time)
    stride = max(1, round(1.0 / FRAMES_PER_SECOND / float(run.time[1] - run.time[0])))
    frames = []
    for k in range(0, len(run.time), stride):
        at = robot.workspace_at(run.q[k])
        legs = {
            side: [
                [round(float(v), 3) for v in at.frame_placement(f"{side}_{part}")[1]]
                for part in ("abduct", "thigh", "shank", "foot")
            ]
            for side in sides
        }
        rotation, base = at.frame_placement("torso")
        head = base + 0.4 * rotation[:, 2]
        frames.append(
            {
                "t": round(float(run.time[k]), 3),
                "base": [round(float(v), 3) for v in base],
                "head": [round(float(v), 3) for v in head],
                "down": [int(run.contact_mode[k, foot] > 0) for foot in feet],
                "torque": [round(float(run.tau_sea[k, knee]), 1) for knee in knees],
                "force": [round(float(run.contact_force[k, foot, 2]), 1) for foot in feet],
                "delay": round(1e3 * float(delay[k]), 2),
                **{side: [[round(float(v), 3) for v in base], *leg] for side, leg in legs.items()},
            }
        )
    xs = np.arange(frames[0]["base"][0] - 1.2, frames[-1]["base"][0] + 1.4, 0.05)
    ground = [[round(float(x), 3), round(walk.case.walking.ground.height(x, 0.0), 3)] for x in xs]
    data = {"rate": FRAMES_PER_SECOND, "terrain": ground, "frames": frames}
    environment = jinja2.Environment(loader=jinja2.PackageLoader("humanoids2016"), autoescape=True)
    template = environment.get_template("playback.html")
    return template.render(data=Markup(json.dumps(data, separators=(",", ":"))))
