"""Where each row of the paper is computed, or why it is not."""

from typing import NamedTuple

from humanoids2016._page import Section, Table


class Row(NamedTuple):
    """One numbered part of the paper.

    Attributes:
        part: its number or name.
        says: what it says, in our words.
        here: where it is computed, or why it is not.
    """

    part: str
    says: str
    here: str


ROWS = (
    Row("(1), (2)", "Kinetic energy with the rotors' coupling C(q), potential energy of gravity "
        "and springs.", "Energy stores of the simulator's audit; with C(q) in section “What the "
        "paper leaves out”."),
    Row("(3)", "Equations of motion with C(q).", "A second plant integrates (3) with C(q), b_q and "
        "b_θ beside the first; section “What the paper leaves out”."),
    Row("(4)–(6)", "Links, motors, springs; contact forces F_r.", "The simulator's plant; section "
        "“The loop”. Checked against Pinocchio and MuJoCo in the tests."),
    Row("(7), (8)", "Torque feedback as inertia shaping, embedded damping.", "The simulator's "
        "drive, exact between instants; every certificate's B_s and D_θ."),
    Row("(9)", "(8) in (4).", "Follows; the frozen loop of the exact margin has this form."),
    Row("(10)", "Task dynamics with Λ, μ, p and F_c.", "Λ and J* as printed; p is gravity "
        "compensation. Size of μ along the walk, and the plant's answer to F_c against (10): "
        "section “What the paper leaves out”."),
    Row("(11), (12)", "The delayed law.", "stiffness_form = \"published\", feedback = \"motor\" or "
        "\"static_joint\"; ticked in every simulation of the published law."),
    Row("(13), (14)", "Γ_sea under delay, d_0 = T_H + T_L/2.", "Fig. 5 (lags measured); the same "
        "delays in simulation and certificate. The matrices are late too."),
    Row("(15), (16)", "Equilibrium map θ_0 = h(q_0), l(q).", "q̄(θ) by the same fixed point, with "
        "its contraction factor in “Certified criterion”."),
    Row("(17)", "The law with q̄(θ).", "feedback = \"static_joint\". Its motor-side stiffness is "
        "not K_q: (29) is unsafe there, section “Where (29) is unsafe”. x_d(q̄(t)) is x_d(t) here; "
        "what a reference of q̄ does stands in “What the paper leaves out”."),
    Row("(18)–(22)", "Energy tank, u, v_1, v_ref and the matrix K_b; never empty for small ε.",
        "As printed beside the corrected flow, section “Each subsystem at its own port”; claims “x "
        "hat” and “tank”. In a project file feedback = \"static_joint_tank\", K_b a scalar."),
    Row("(23)", "∂V_l/∂θ = l: a potential.", "Requires a symmetric stiffness; ΛK_x in general is "
        "not. “Certified criterion” gives the asymmetry."),
    Row("(24)–(26)", "S_j = V_1: the joint side is passive at (Γ_sea, q̇_j).", "Observed at that "
        "port on a leg, claim “subsystems”, and along the walk, section “Energy of the walk”."),
    Row("(27), (28)", "S_c = V_2 + V_3 + V_4: the controller's side is passive at (q̇_j, −Γ_sea).",
        "Observed at that port with E_s in V_4, section “Each subsystem at its own port”. (27) "
        "drops the gradient of the late ḡ(θ), which the certified criterion keeps."),
    Row("(29), Theorem 1", "Largest delay as an LMI; then passive, and θ̇ bounded.", "In closed "
        "form, “The criteria”; along the walk, “Fig. 4”; claims “sufficient” and “motor speed”."),
    Row("(30), (31), Corollary 1", "Several priority levels.", "Section “Priority levels”."),
    Row("Assumptions 1, 2", "Rotors symmetric and turning about their own axes.", "The plant has "
        "them."),
    Row("Assumption 3", "C(q) ≈ 0.", "Assumed elsewhere; its error over gear ratios in “What the "
        "paper leaves out”."),
    Row("Assumption 4", "d_1 = T_H + T_L/2 and d_2 have upper bounds.", "Taken from the delays of "
        "the project, with jitter, loss and the hold of the sampled controller."),
    Row("Remark 1", "Feedback of the torque's derivative.", "Spring damping with and without it, "
        "section “What the paper leaves out”."),
    Row("Remark 2", "ḡ(θ) is gravity at q̄.", "gravity = \"feedback\"; its gradient counts as "
        "stiffness."),
    Row("Section III, [16]", "Delayed damping hurts more than delayed stiffness.", "Claim “central "
        "damping”."),
    Row("Figs. 1–3", "Architecture, layers, interconnection.", "Section “The loop”. Model updates "
        "slower than the controller (Fig. 2): simulation.model_period_ms and “What the paper "
        "leaves out”."),
    Row("Section V", "A 7-step walk of one leg's dynamics, CoM and orientation as the 6-D task.",
        "Planned and simulated with both legs; the printed law on that very task in “Ablation of "
        "the walking controller”."),
    Row("Fig. 4", "Largest delay against α and D_θ[0].", "Section “Fig. 4”, over the planned and "
        "the simulated walk."),
    Row("Fig. 5", "Γ_osc and Γ_sea for several β.", "Section “Fig. 5”."),
    Row("Conclusion 1", "More K_x for more D_θ or less delay.", "Claims “stiffness” and “alpha”: "
        "theorems; “one joint”: as in [22]."),
    Row("Conclusion 2", "D_θ costs torque transparency.", "Claim “damping deviation”."),
    Row("Conclusion 3", "(31) has the smaller range.", "Claim “levels” and section “Priority "
        "levels”."),
    Row("Future work (i)", "Time-varying matrices.", "Section “Beyond the paper”: one multiplier "
        "for the whole walk, and polytopes."),
    Row("Future work (ii)", "Asymmetric delays.", "central_up, central_down, embedded_up and "
        "embedded_down in the project file; d_1 is what certificate and simulation take. A "
        "constant delay acts alike on both ways; a varying one need not."),
    Row("Future work (iii)", "Optimal central controller; central against embedded damping.",
        "Claims “central damping”: what it costs to compute damping centrally, and “tuned "
        "gains”. sealag tune --aim mapping and --aim optimal; docs/theory, section 16."),
    Row("Future work (iv)", "Experiments; Coulomb friction, torque bandwidth.", "Walks with both, "
        "section “Beyond the paper”. No experiment on hardware."),
)  # fmt: skip
"""All numbered parts of the paper, in its order."""


def concordance_section() -> Section:
    """Tabulate every numbered part of the paper."""
    table = Table(
        title="The paper's equations, assumptions, figures, conclusions and future work",
        columns=["In the paper", "It says", "Here"],
        rows=[list(row) for row in ROWS],
        stack=True,
        open=True,
    )
    return Section(anchor="rows", title="The paper, row by row", blocks=[table])
