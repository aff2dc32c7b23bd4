"""What the paper leaves open and was chosen here."""

from humanoids2016._figure4 import STIFFNESS_SCALE
from humanoids2016._findings import Findings
from humanoids2016._page import Section, Table


def assumptions_section(found: Findings) -> Section:
    """Tabulate every choice that the paper does not state.

    Args:
        found: what the study computed.
    """
    figure, walk, system = found.figure, found.walk.case.walking, found.system
    drives, gait = system.actuators, walk.gait
    alpha, first = figure.alpha, figure.abduction_damping
    rows = [
        ["α in Fig. 4", f"{len(alpha)} values from {alpha[0]:g} to {alpha[-1]:g}",
         "read off the figure's axis; no values are printed"],
        ["D_θ[0] in Fig. 4", ", ".join(f"{d:g}" for d in first) + " Nms/rad",
         "the text has 10; the other two are chosen"],
        ["K_x", "diag(100, 100, 100, 50, 50, 50) in 1/s²",
         "the paper writes N/m and Nm/rad; in (11) it multiplies Λ, so its unit is 1/s²"],
        ["factors on K_x", ", ".join(f"{s:g}" for s in STIFFNESS_SCALE), "for the claim"],
        ["spring stiffness K", f"{drives.spring_stiffness.min():g} Nm/rad, other values beside it",
         "not published"],
        ["β outside Fig. 5", f"{drives.shaped_inertia[0] / drives.rotor_inertia[0]:g}",
         "not published"],
        ["robot", "Hume's published masses and lengths; torque limits and friction left out",
         "the public control code of its authors"],
        ["walk", f"{walk.steps} steps at {gait.apex_speed:g} m/s over the foot, "
         f"{gait.step_time:g} s a step, {gait.step_width:g} m wide, CoM {gait.com_height:g} m "
         "over the footholds", "the paper cites a 7-step walk without these numbers"],
        ["torso", "upright along the plan", "not stated"],
        ["planned feet", "one foot stands at a time", "a point foot each"],
        ["gravity compensation", "planned, and from q̄(θ) where named",
         "(11) feeds it back; certified only where its stiffness is symmetric"],
        ["delays", "T_H = 20 + 10 sin t ms, T_L = 3 + 2 sin t ms, controller at 1 kHz",
         "as printed; the rate is chosen"],
    ]  # fmt: skip
    table = Table(
        title="Choices and units",
        columns=["What", "Here", "Because"],
        rows=rows,
        stack=True,
        open=True,
    )
    return Section(anchor="assumptions", title="What is assumed", blocks=[table])
