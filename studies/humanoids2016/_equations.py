"""The equations that the article shows, as MathML that needs no network."""

from humanoids2016._page import Equation


def plant() -> tuple[Equation, ...]:
    """Links, motors and springs, and the drive's own loop."""
    return (
        Equation(
            latex=r"A(q)\ddot q + N(q,\dot q) + J_s^T F_r = U^T \Gamma_{sea}, \qquad "
            r"B\ddot\theta + \Gamma_{sea} = \Gamma_m, \qquad \Gamma_{sea} = K(\theta - q_j)",
            number="(4)–(6)",
        ),
        Equation(
            latex=r"\Gamma_m = B B_s^{-1}\Gamma_{osc} + (I - B B_s^{-1})\Gamma_{sea} "
            r"- B B_s^{-1} D_\theta \dot\theta \quad\Rightarrow\quad "
            r"\Gamma_{osc} = B_s\ddot\theta + \Gamma_{sea} + D_\theta\dot\theta",
            number="(7), (8)",
        ),
    )


def law() -> tuple[Equation, ...]:
    """The delayed whole-body law."""
    return (
        Equation(
            latex=r"\Gamma_{osc}(t) = J^{*T}\Lambda K_x \left( x_d(t) - x(\bar q(t - "
            r"\tfrac{T_H}{2})) \right) + \bar g(\theta), \qquad "
            r"\theta_0 = q_0 + K^{-1} l(q_0)",
            number="(15)–(17)",
        ),
    )


def published_criterion() -> tuple[Equation, ...]:
    """Theorem 1 and Corollary 1 as printed, and their closed form."""
    return (
        Equation(
            latex=r"\exists\, Q \succ 0: \quad \begin{pmatrix} -D_\theta + \tfrac12 \bar d_1 "
            r"J^{*T} Q J^* & \tfrac12 \bar d_1 J^{*T}\Lambda K_x \\ \star & -\tfrac12 \bar d_1 Q "
            r"\end{pmatrix} \preceq 0",
            number="(29)",
        ),
        Equation(
            latex=r"\bar d_1 = \frac{1}{w\left( D_\theta^{-1/2} J^{*T}\Lambda K_x J^* "
            r"D_\theta^{-1/2} \right)}, \qquad w(A) = \max_\varphi \lambda_{\max}"
            r"\left( \tfrac12 (e^{i\varphi} A + e^{-i\varphi} A^T) \right)",
            number="closed form",
        ),
        Equation(
            latex=r"\begin{pmatrix} -D_\theta + \tfrac12 \bar d_1 \sum_i J_i^{*T} Q_i J_i^* & "
            r"\tfrac12 \bar d_1 M_1 & \cdots & \tfrac12 \bar d_1 M_N \\ \star & -\tfrac12 \bar d_1 "
            r"Q_1 & & 0 \\ \star & & \ddots & \\ \star & 0 & & -\tfrac12 \bar d_1 Q_N "
            r"\end{pmatrix} \preceq 0, \qquad M_i = J_i^{*T}\Lambda_i K_{x,i}",
            number="(31)",
        ),
    )


def certified_criterion() -> tuple[Equation, ...]:
    """The corrected criterion, and what makes its stiffness a potential's."""
    return (
        Equation(
            latex=r"F = -\frac{\partial \tau_{osc}}{\partial \theta} = F^T \succeq 0, \qquad "
            r"d_1 \le \frac{1}{\lambda_{\max}\left( D_\theta^{-1/2} F D_\theta^{-1/2} \right)}",
            number="certified",
        ),
        Equation(
            latex=r"F_\theta = J^{*T}\Lambda^{1/2} K_x \Lambda^{1/2} J^* = K_q, \qquad "
            r"F_{\bar q} = \left( K_q^{-1} - K^{-1} \right)^{-1} \succ K_q",
            number="θ and q̄(θ) fed back",
        ),
    )


def tank() -> tuple[Equation, ...]:
    """The published tank, and one that pays for the work on the spring potential."""
    return (
        Equation(
            latex=r"\hat{\dot x} = u + J^*\dot\theta, \qquad s\dot s = -\tfrac12 \bar d_1 u^T Q u "
            r"- \bar d_1 u^T Q J^* \dot\theta",
            number="(18)–(20)",
        ),
        Equation(
            latex=r"\dot E_s = \tilde{\hat x}^T S u - \tfrac12 \bar d_1 u^T Q u "
            r"- \bar d_1 u^T Q J^* \dot\theta, \qquad u = 0 \text{ when } E_s = 0",
            number="corrected",
        ),
    )
