"""The part of the paper's page on what the paper leaves out: slow models, C(q), μ, F_c, x_d(q̄)."""

from humanoids2016._findings import Findings
from humanoids2016._page import Cell, Section, Table, Text
from humanoids2016._rotors import LATE, TICK
from humanoids2016._slow_model import MARGINS, SWING
from humanoids2016._task_terms import PUSH


def left_out_section(found: Findings) -> Section:
    """Put a number on each term that the paper drops or leaves open.

    Args:
        found: what the study computed.
    """
    return Section(
        anchor="left-out",
        title="What the paper leaves out",
        blocks=[*_slow(found), *_rotors(found), *_torque_rates(found), *_terms(found)],
    )


def _number(text: str) -> Cell:
    return Cell(text=text, css="number")


def _slow(found: Findings) -> tuple[Text, Table]:
    rows = []
    for one in found.slow:
        stale = "–" if one.stale_asymmetry < 0.0 else f"{one.stale_asymmetry:.2f}"
        unstable = f"{one.unstable} of {one.stale}" if one.stale else "–"
        rows.append([
            _number("every tick" if one.period == 0.0 else f"{one.period * 1e3:g}"),
            _number(f"{one.asymmetry:.3f}"), _number(f"{one.bound_s * 1e3:.2f}"),
            _number(f"{one.margin_s * 1e3:.2f}"), _number(stale),
            _number(unstable),
            _number(f"{one.away_rad * 1e3:.2f}"), _number(f"{one.torque_nm:.2f}"), one.outcome,
        ])  # fmt: skip
    return (
        Text(
            text=(
                "Fig. 2 updates the kinematics and dynamics model more slowly than the controller "
                "ticks. In a project file that is simulation.model_period_ms: J* and S are held, x "
                "and ḡ are not. Then −∂Γ_osc/∂θ = J*_uᵀ S_u J* with the update's J*_u, which is "
                "not symmetric while the robot moves: V_3 is lost by that much, the bound of (29) "
                "hardly moves. What hurts is a change of support that the model has not seen. The "
                f"last three columns are a run of Hume's legs, torso held, one foot swung by "
                f"{SWING['track_amplitude']:g} m at {SWING['track_frequency_hz']:g} Hz."
            )
        ),
        Table(
            title="Fig. 2: a model that is updated slowly",
            columns=[
                "update (ms)", "asymmetry", "(29) (ms)", "exact margin (ms)",
                "asymmetry, support changed", "unstable then", "joints off (mrad)",
                "torque off (Nm)", "run",
            ],
            rows=rows,
            open=True,
            note="Asymmetry: largest ‖F − Fᵀ‖/‖F + Fᵀ‖ along the planned walk. Exact margin of the "
            f"stance leg, torso held, at {MARGINS} instants; unstable without delay among those "
            "whose support had changed since the update.",
        ),
    )  # fmt: skip


def _rotors(found: Findings) -> tuple[Text, Table]:
    rows = [
        [
            _number(f"{row.ratio:g}"), _number(f"{row.coupling:.2%}"), _number(f"{row.link:.2%}"),
            _number(f"{row.motor:.2%}"), _number(f"{row.torque_nm:.3f}"),
            _number(f"{row.margin_s * 1e3:.3f}"), _number(f"{row.margin_change:.1e}"),
            _number(f"{row.swing_rad * 1e3:.3f}"), _number(f"{row.swing_nm:.4f}"),
        ]
        for row in found.rotors.rows
    ]  # fmt: skip
    return (
        Text(
            text=(
                "Assumption 3 drops C(q), b_q and b_θ of (3). With a rotor on the link before its "
                "joint, spinning r times as fast about the joint's axis, C = J_ωᵀ z B/r. The plant "
                "of (3) is integrated beside that of (4) and (5), on which the torque feedback of "
                "(7) acts without knowing C. Without C it agrees with the simulator of all other "
                f"sections to {found.rotors.reference_rad:.0e} rad over "
                f"{found.rotors.swing_time:g} s. Hume's gear ratios are not published."
            )
        ),
        Table(
            title="The error of Assumption 3 over gear ratios",
            columns=[
                "r", "coupling", "error of q̈_j", "error of θ̈", "left out of (5) (Nm)",
                "exact margin (ms)", "margin changes by", "swing off (mrad)", "torque off (Nm)",
            ],
            rows=rows,
            open=True,
            note="Coupling: ‖B^(−½) Cᵀ A^(−½)‖, 1 where the inertia is singular. Errors: RMS over "
            "RMS along the simulated walk, with its torques and feet. Margin of the stance leg, "
            f"torso held. Swing: a leg in the air under the paper's law, {LATE * TICK * 1e3:g} ms "
            "late.",
        ),
    )  # fmt: skip


def _torque_rates(found: Findings) -> tuple[Text, Table]:
    rows = [
        [
            _number(f"{row.damping:g}"), _number(f"{row.without_s * 1e3:.2f}"),
            _number(f"{row.with_s * 1e3:.2f}"), _number(f"{row.asymmetry:.3f}"),
        ]
        for row in found.torque_rates
    ]  # fmt: skip
    return (
        Text(
            text=(
                "Remark 1: a spring with damping D carries Γ_sea + DK⁻¹Γ̇_sea. With (7) as printed "
                "the shaped motor feels βDK⁻¹Γ̇_sea of it, the link all. With the derivative fed "
                "back beside Γ_sea both feel the same, and the damping is symmetric again."
            )
        ),
        Table(
            title="Remark 1: spring damping and feedback of the torque's derivative",
            columns=[
                "D (Nms/rad)", "margin with (7) as printed (ms)",
                "margin with the derivative fed back (ms)", "asymmetry of the damping without it",
            ],
            rows=rows,
            open=True,
            note="Exact margins of the stance leg, torso held; smallest over the planned walk.",
        ),
    )  # fmt: skip


def _terms(found: Findings) -> tuple[Text, Table]:
    terms = found.terms
    rows = [
        [
            row.name, _number(f"{row.asymmetry:.3f}"), _number(f"{row.least:.2f}"),
            _number(f"{row.bound_s * 1e3:.2f}"), _number(f"{row.margin_s * 1e3:.2f}"),
            _number(f"{row.unstable} of {row.instants}"),
        ]
        for row in found.references
    ]  # fmt: skip
    return (
        Text(
            text=(
                f"(11) leaves out μ of (10): along the simulated walk it is {terms.mu_n:.2g} N RMS "
                f"at the CoM, where ΛK_x x̃ of the CoM's height is {terms.feedback_n:.0f} N. F_c, a "
                f"force of {PUSH[0]:g} N and a torque of {PUSH[4]:g} Nm at the task point, "
                "accelerates the plant as (10) says, Λ Δẍ = −F_c, to "
                f"{terms.residual:.0e} of it. (17) takes the reference at q̄(t). Where x_d moves "
                "with q̄ it is feedback: F = J*ᵀ S (J* − ∂x_d/∂q̄)."
            )
        ),
        Table(
            title="(17): a reference that is a function of q̄",
            columns=[
                "reference", "asymmetry", "least eigenvalue (Nm/rad)", "(29) (ms)",
                "exact margin (ms)", "unstable",
            ],
            rows=rows,
            note=f"The stance leg at {found.references[0].instants} instants of the planned walk, "
            "its torso held; (29) with this F for J*ᵀΛK_x J*. Least eigenvalue of the symmetric "
            "part; an asymmetric F has no potential, whatever (29) says.",
        ),
    )  # fmt: skip
