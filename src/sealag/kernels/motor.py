"""Motor kernels: one series elastic joint moved exactly over a step, and its works.

A joint's vector z (9,) is [theta, theta_dot, motor torque state, q, q̇, q̈, q⃛, u, w]: link motion
is a cubic over the step, u is the held command, w a constant torque on the rotor. z obeys
ż = A z, so z and the integrals of products of its entries follow from exponentials alone.

``parameters`` (n, 11) columns: K, D_s, B, B / B_s, D_theta, viscous friction, Coulomb friction,
torque limit, velocity limit, torque bandwidth (rad/s, inf if ideal), and the damping of the joint's
bearing on the link's side, which no motor feels. ``instant`` is 1.0 if the embedded torque feedback
is not delayed.

Works (n, 8): ∫θ̇², ∫τ_sea q̇, ∫τ_sea θ̇, ∫(θ̇ − q̇)², ∫τ_m θ̇, ∫|θ̇| (Coulomb), ∫τ_osc θ̇, ∫q̇².
"""

import math

import numpy as np
from numba import njit

SIZE = 9
PRODUCTS = 5
ANGLE, SPEED, TORQUE, LINK, LINK_SPEED, COMMAND = 0, 1, 2, 3, 4, 7  # places in z
REGULAR, LIMITED, LOCKED = 0, 1, 2  # LOCKED adds to the other two
_TERMS = 12
_MOVING = 6  # entries of z that change by themselves; the others are constants of the step
_LONG = 18  # terms of a series over a piece of time in which A moves z by as much as itself


@njit(cache=True)
def generator(p, instant, variant, A, Q):
    """Write A (9, 9) and the five product forms Q (5, 9, 9) of a joint in a variant."""
    K, D_s, B, ratio, D_theta, viscous = p[0], p[1], p[2], p[3], p[4], p[5]
    bandwidth = p[9]
    A[:] = 0.0
    A[3, 4] = A[4, 5] = A[5, 6] = 1.0
    spring = np.zeros(SIZE)
    spring[0], spring[3], spring[1], spring[4] = K, -K, D_s, -D_s
    command = np.zeros(SIZE)
    if variant % 2 == LIMITED:
        command[7] = 1.0
    else:
        command[7] = ratio
        command[1] = -ratio * D_theta
        command += instant * (1.0 - ratio) * spring
    torque = command
    if bandwidth != np.inf:
        A[2] = bandwidth * command
        A[2, 2] -= bandwidth
        torque = np.zeros(SIZE)
        torque[2] = 1.0
    if variant < LOCKED:
        A[0, 1] = 1.0
        A[1] = (torque - spring) / B
        A[1, 1] -= viscous / B
        A[1, 8] += 1.0 / B
    speed = np.zeros(SIZE)
    speed[1] = 1.0
    link = np.zeros(SIZE)
    link[4] = 1.0
    _product(speed, speed, Q[0])
    _product(spring, link, Q[1])
    _product(spring, speed, Q[2])
    _product(speed - link, speed - link, Q[3])
    _product(torque, speed, Q[4])


@njit(cache=True)
def _product(a, b, Q):
    for i in range(SIZE):
        for j in range(SIZE):
            Q[i, j] = 0.5 * (a[i] * b[j] + a[j] * b[i])


@njit(cache=True)
def _multiply(X, Y, out):
    for i in range(SIZE):
        for j in range(SIZE):
            out[i, j] = 0.0
        for k in range(SIZE):
            x = X[i, k]
            if x != 0.0:
                for j in range(SIZE):
                    out[i, j] += x * Y[k, j]


@njit(cache=True)
def _norm(A):
    norm = 0.0
    for j in range(SIZE):
        s = 0.0
        for i in range(SIZE):
            s += abs(A[i, j])
        norm = max(norm, s)
    return norm


@njit(cache=True)
def _halvings(A, time):
    return max(0, math.ceil(math.log2(max(_norm(A) * time, 1e-30) / 0.25)))


@njit(cache=True)
def exponential(A, time, E):
    """Write e^{A time} by scaling, Taylor series and squaring."""
    halvings = _halvings(A, time)
    t = time / 2.0**halvings
    term = np.eye(SIZE)
    other = np.empty((SIZE, SIZE))
    E[:] = np.eye(SIZE)
    for k in range(1, _TERMS + 1):
        _multiply(term, A, other)
        term[:] = other * (t / k)
        E += term
    for _ in range(halvings):
        _multiply(E, E, other)
        E[:] = other


@njit(cache=True)
def flow(A, z, time, out):
    """Write e^{A time} z without the exponential, by Taylor series over pieces of the time."""
    pieces = max(1, math.ceil(_norm(A) * time))
    t = time / pieces
    term, rate = np.empty(SIZE), np.empty(_MOVING)
    out[:] = z
    for _ in range(pieces):
        term[:] = out
        for k in range(1, _LONG + 1):
            for i in range(_MOVING):
                rate[i] = 0.0
                for j in range(SIZE):
                    rate[i] += A[i, j] * term[j]
            for i in range(_MOVING):
                term[i] = rate[i] * (t / k)
                out[i] += term[i]
            for i in range(_MOVING, SIZE):
                term[i] = 0.0


@njit(cache=True)
def advance(A, Q, time, E, W):
    """Write E = e^{A time} and W_k = ∫₀^time e^{Aᵀs} Q_k e^{As} ds for the five forms."""
    halvings = _halvings(A, time)
    t = time / 2.0**halvings
    other = np.empty((SIZE, SIZE))
    half = np.empty((SIZE, SIZE))
    exponential(A, t, E)
    At = A.T.copy()
    for k in range(PRODUCTS):
        form = Q[k].copy()
        weight = t
        W[k] = form * weight
        for j in range(1, _TERMS + 1):
            _multiply(At, form, other)  # form is symmetric: form A is its transpose
            form[:] = other + other.T
            weight *= t / (j + 1)
            W[k] += form * weight
    for _ in range(halvings):
        Et = E.T.copy()
        for k in range(PRODUCTS):
            _multiply(W[k], E, half)
            _multiply(Et, half, other)
            W[k] += other
        _multiply(E, E, other)
        E[:] = other


@njit(cache=True)
def tables(parameters, instant, step, half_step, whole_step, works):
    """Fill exponentials over half and whole steps (n, 4, 9, 9) and forms (n, 4, 5, 9, 9)."""
    A = np.empty((SIZE, SIZE))
    Q = np.empty((PRODUCTS, SIZE, SIZE))
    for i in range(parameters.shape[0]):
        for variant in range(4):
            generator(parameters[i], instant, variant, A, Q)
            exponential(A, 0.5 * step, half_step[i, variant])
            advance(A, Q, step, whole_step[i, variant], works[i, variant])


@njit(cache=True)
def spring_torque(p, z):
    """Return tau_sea = K (theta - q) + D_s (theta_dot - q_dot) of one joint."""
    return p[0] * (z[0] - z[3]) + p[1] * (z[1] - z[4])


@njit(cache=True)
def choose(p, instant, tau_osc, tau_measured, z):
    """Set u and w of a joint for what lies ahead; return variant and direction of motion."""
    ratio, coulomb = p[3], p[6]
    spring = spring_torque(p, z)
    shift = 0.0
    if instant == 0.0:
        shift = (1.0 - ratio) / ratio * tau_measured
    z[7] = tau_osc + shift
    command = ratio * (z[7] - p[4] * z[1]) + instant * (1.0 - ratio) * spring
    upper = p[7] if z[1] < p[8] else 0.0
    lower = -p[7] if z[1] > -p[8] else 0.0
    variant = REGULAR
    if command > upper or command < lower:
        variant = LIMITED
        command = min(max(command, lower), upper)
        z[7] = command
    z[8] = 0.0
    direction = 0.0
    if coulomb > 0.0:
        torque = command if p[9] == np.inf else z[2]
        net = torque - spring
        if z[1] == 0.0 and abs(net) <= coulomb:
            variant += LOCKED
        else:
            direction = math.copysign(1.0, z[1] if z[1] != 0.0 else net)
            z[8] = -direction * coulomb
    if p[9] == np.inf:
        z[2] = command
    return variant, direction


@njit(cache=True)
def _apply(E, z, out):
    for i in range(SIZE):
        s = 0.0
        for j in range(SIZE):
            s += E[i, j] * z[j]
        out[i] = s


@njit(cache=True)
def _reversal(A, z, direction, time, out):
    """Return the instant in (0, time) at which the speed passes through zero (Illinois)."""
    low, high = 0.0, time
    f_low = direction * z[1]
    flow(A, z, time, out)
    f_high = direction * out[1]
    for _ in range(30):
        middle = (low * f_high - high * f_low) / (f_high - f_low)
        flow(A, z, middle, out)
        f = direction * out[1]
        if abs(f) < 1e-13 or high - low < 1e-13 * time:
            return middle
        if f < 0.0:
            high, f_high = middle, f
            f_low *= 0.5
        else:
            low, f_low = middle, f
            f_high *= 0.5
    return 0.5 * (low + high)


@njit(cache=True)
def predict(
    parameters, instant, tau_osc, tau_measured, z, step, half_step, whole_step, regular, out
):
    """Motor angle and speed half a step and a step ahead, out (n, 2, 2); z is not moved."""
    A = np.empty((SIZE, SIZE))
    Q = np.empty((PRODUCTS, SIZE, SIZE))
    now = np.empty(SIZE)
    then = np.empty(SIZE)
    for i in range(parameters.shape[0]):
        now[:] = z[i]
        variant, _ = choose(parameters[i], instant, tau_osc[i], tau_measured[i], now)
        if regular:
            _move_rotor(half_step[i, variant], now, out[i, 0])
            _move_rotor(whole_step[i, variant], now, out[i, 1])
        else:
            generator(parameters[i], instant, variant, A, Q)
            flow(A, now, 0.5 * step, then)
            out[i, 0, 0], out[i, 0, 1] = then[0], then[1]
            flow(A, then, 0.5 * step, now)
            out[i, 1, 0], out[i, 1, 1] = now[0], now[1]


@njit(cache=True)
def _move_rotor(E, z, out):
    """Write angle and speed (2,) of E z."""
    for i in range(2):
        s = 0.0
        for j in range(SIZE):
            s += E[i, j] * z[j]
        out[i] = s


@njit(cache=True)
def link_cubic(z, q_0, v_0, q_1, v_1, step):
    """Set the cubic link motion of every joint through both ends of the step."""
    for i in range(z.shape[0]):
        rise = q_1[i] - q_0[i] - step * v_0[i]
        turn = v_1[i] - v_0[i]
        z[i, 3], z[i, 4] = q_0[i], v_0[i]
        z[i, 5] = 6.0 * rise / step**2 - 2.0 * turn / step
        z[i, 6] = 6.0 * turn / step**2 - 12.0 * rise / step**3


@njit(cache=True)
def add_link_work(z, step, work):
    """Add ∫q̇² of every joint (n, 8) along the cubic that `link_cubic` has set."""
    for i in range(z.shape[0]):
        a, b, c = z[i, 4], z[i, 5] * step, 0.5 * z[i, 6] * step**2
        work[i, 7] += step * (
            a * a + a * b + (b * b + 2.0 * a * c) / 3.0 + 0.5 * b * c + 0.2 * c * c
        )


@njit(cache=True)
def _add_works(W, z, after, tau_osc, work):
    """Add zᵀ W_k z of the symmetric forms, and the works that follow from the way travelled."""
    for k in range(PRODUCTS):
        s = 0.0
        for a in range(SIZE):
            t = 0.5 * W[k, a, a] * z[a]
            for b in range(a + 1, SIZE):
                t += W[k, a, b] * z[b]
            s += z[a] * t
        work[k] += 2.0 * s
    travel = after[0] - z[0]
    work[5] += abs(travel)
    work[6] += tau_osc * travel


@njit(cache=True)
def move(
    parameters, instant, tau_osc, tau_measured, z, step, tables_E, tables_W, regular, book, work
):
    """Move every joint over the step along its link's cubic; if ``book``, add its works (n, 8)."""
    A = np.empty((SIZE, SIZE))
    Q = np.empty((PRODUCTS, SIZE, SIZE))
    E = np.empty((SIZE, SIZE))
    W = np.empty((PRODUCTS, SIZE, SIZE))
    after = np.empty(SIZE)
    for i in range(parameters.shape[0]):
        left = step
        whole = regular
        for _ in range(8):
            p = parameters[i]
            variant, direction = choose(p, instant, tau_osc[i], tau_measured[i], z[i])
            if whole:
                _apply(tables_E[i, variant], z[i], after)
            else:
                generator(p, instant, variant, A, Q)
                flow(A, z[i], left, after)
            span = left
            reversing = direction != 0.0 and after[1] * direction < 0.0
            if reversing:
                whole = False
                if z[i, 1] == 0.0:
                    variant = variant % 2 + LOCKED
                    z[i, 8] = 0.0
                    reversing = False
                    generator(p, instant, variant, A, Q)
                else:
                    generator(p, instant, variant, A, Q)
                    span = _reversal(A, z[i], direction, left, after)
                flow(A, z[i], span, after)
            if book:
                if not whole:
                    advance(A, Q, span, E, W)
                form = tables_W[i, variant] if whole else W
                _add_works(form, z[i], after, tau_osc[i], work[i])
            z[i] = after
            if reversing:
                z[i, 1] = 0.0
            if not reversing or left - span <= 1e-12 * step:
                break
            left -= span
            whole = False
        choose(parameters[i], instant, tau_osc[i], tau_measured[i], z[i])


@njit(cache=True)
def stores(parameters, z, q, power, out):
    """Write kinetic, gravity, spring and motor energy (4,); link angles are q's last entries.

    ``power`` (6,) is an instant's, whose last two are the links' energies.
    """
    n = parameters.shape[0]
    out[0], out[1], out[2], out[3] = power[4], power[5], 0.0, 0.0
    for i in range(n):
        stretch = z[i, 0] - q[q.size - n + i]
        out[2] += 0.5 * parameters[i, 0] * stretch * stretch
        out[3] += 0.5 * parameters[i, 2] * z[i, 1] * z[i, 1]


@njit(cache=True)
def tally(parameters, work, powers, step, z, q, power, joint, scalar, energy, moved):
    """Add one step to the ledger: joint works, Runge-Kutta integrals of powers, store changes."""
    for i in range(parameters.shape[0]):
        joint[0, i] += work[i, 1]
        joint[1, i] += work[i, 2]
        joint[2, i] += work[i, 4]
        joint[3, i] += work[i, 6]
        joint[4, i] += parameters[i, 4] * work[i, 0]
        joint[5, i] += parameters[i, 5] * work[i, 0]
        joint[6, i] += parameters[i, 6] * work[i, 5]
        joint[7, i] += parameters[i, 1] * work[i, 3]
        joint[8, i] += parameters[i, 10] * work[i, 7]
    for k in range(4):
        mean = powers[0, k] + 2.0 * (powers[1, k] + powers[2, k]) + powers[3, k]
        scalar[k] += step / 6.0 * mean
    before = energy.copy()
    stores(parameters, z, q, power, energy)
    for k in range(4):
        moved[0] += abs(energy[k] - before[k])


def warm() -> None:
    """Compile every kernel with the types used in practice."""
    parameters = np.array([[350.0, 0.0, 0.1, 2.0, 10.0, 0.0, 0.1, np.inf, np.inf, np.inf, 0.0]])
    half, whole = np.empty((1, 4, SIZE, SIZE)), np.empty((1, 4, SIZE, SIZE))
    forms = np.empty((1, 4, PRODUCTS, SIZE, SIZE))
    tables(parameters, 1.0, 1e-3, half, whole, forms)
    z, tau, work, ahead = np.zeros((1, SIZE)), np.zeros(1), np.zeros((1, 8)), np.zeros((1, 2, 2))
    predict(parameters, 1.0, tau, tau, z, 1e-3, half, whole, True, ahead)
    link_cubic(z, tau, tau, tau, tau, 1e-3)
    add_link_work(z, 1e-3, work)
    move(parameters, 1.0, tau, tau, z, 1e-3, whole, forms, True, True, work)
    energy, joint, scalar = np.zeros(4), np.zeros((9, 1)), np.zeros(5)
    stores(parameters, z, tau, np.zeros(6), energy)
    powers = np.zeros((4, 6))
    tally(parameters, work, powers, 1e-3, z, tau, powers[0], joint, scalar, energy, np.zeros(1))
