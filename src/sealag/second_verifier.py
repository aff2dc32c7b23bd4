"""A second verifier of sealag certificates: one file, standard library only, exact arithmetic.

Run `python second_verifier.py CERTIFICATE`. It shares no line with the first and imports nothing of
sealag. A double is a rational number, and a symmetric matrix is positive definite if and only if
the pivots of L D Lᵀ are positive, which whole numbers, rounded to the safe side, show.
Each line of the output is a claim that holds, does not hold, or cannot be decided here. Status: 0
no claim fails, 1 one fails, 2 the file is no certificate.

n joints, D damping, K springs, d delay, W multiplier; of each proven instant the delayed stiffness
F, task stiffness S, Jacobian J, gravity gradient G.
"""

# fmt: off
import hashlib
import json
import math
import sys
from collections.abc import Callable, Iterator
from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal
from fractions import Fraction
from itertools import pairwise, product
from typing import Any

__all__ = ["claims", "decided", "main", "read"]

Matrix = list[list[Any]]
Claim = tuple[str, bool | None, str]  # what; whether it holds, None if undecided; detail
KEYS = """D_theta asymmetry assumptions bounds_s common_multiplier common_multiplier_delay_s
    conservatism contraction criterion critical delay_s equilibrium feedback first_crossing_s
    gravity hashes holds_for instant_basis instant_margins_s instants jitter_margin_s joints
    left_open levels local_loop local_margin_s max_delay_s max_delay_upper_s motor_inertia proofs
    published_max_delay_s reasons rotor_inertia schema spring_damping spring_stiffness stable
    status stiffness_form task_inertia time_s time_varying_delay_s time_varying_multiplier
    time_varying_windows torque_bandwidth unstable_modes versions viscous_friction worst
    worst_motion"""
LARGEST_FILE = 100_000_000  # bytes; ten times more would take 20 GB of memory
MOST_VERTICES = 4096  # of all windows; each costs some 20 ms
AGREE = Fraction(1, 10**9)  # relative difference of redundant numbers, which were rounded
SYMMETRIC = Fraction(1, 10**7)  # asymmetry up to which a certified F counts as symmetric
BITS = 720  # of positive: ten times fewer leave the jitter margin of stiff robots open
DIGITS = 1000  # of the intervals in Routh's table; 400 still decide 56 states

class WrongInputError(ValueError):
    """The file is no certificate of the layout that this verifier reads."""
def read(path: str) -> dict[str, Any]:
    """Read JSON without repeated keys, NaN, infinities or endless digits; `path` is the file."""
    try:
        with open(path, "rb") as file:
            text = file.read(LARGEST_FILE)  # what is cut off there is no JSON
        data = json.loads(text, object_pairs_hook=_once, parse_constant=number,
                          parse_float=_figure, parse_int=_figure)
    except (OSError, ValueError, RecursionError) as error:
        raise WrongInputError(getattr(error, "strerror", None) or str(error)) from error
    odd = set(data if isinstance(data, dict) else {}) ^ set(KEYS.split())
    if odd or data["schema"] != "sealag-certificate/6":
        raise WrongInputError(f"it is not sealag-certificate/6, or has odd keys {sorted(odd)[:5]}")
    return data
def _figure(text: str) -> int | float:
    if not math.isfinite(value := float(text)):
        raise WrongInputError(f"{text[:40]!r} is no finite number")
    return value if set(text) & set(".eE") else int(text)
def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    if len(dict(pairs)) < len(pairs):
        raise WrongInputError(f"a key stands twice among {[key for key, _ in pairs][:20]}")
    return dict(pairs)
def number(value: Any) -> Fraction:
    """Return a finite number as the rational that it is; `value` comes from the file."""
    if type(value) not in (int, float) or not math.isfinite(value):
        raise WrongInputError(f"{str(value)[:40]!r} is no finite number")
    return Fraction(value)
def time(value: Any) -> Any:
    """Return a time: a rational, inf for "unbounded", None for null; `value` is the file's."""
    return None if value is None else math.inf if value == "unbounded" else number(value)
def matrix(values: Any, m: int, n: int) -> Matrix:
    """Return an `m` by `n` matrix of the file's `values`."""
    if not isinstance(values, list) or [len(row) for row in values] != [n] * m:
        raise WrongInputError(f"a matrix is not {m} by {n}")
    return [[number(value) for value in row] for row in values]
def vector(values: Any, n: int) -> list[Fraction]:
    """Return `n` numbers of the file's `values`."""
    return matrix([values], 1, n)[0]
def times(A: Matrix, B: Matrix) -> Matrix:
    """A B."""
    columns = list(zip(*B))
    return [[sum(map(lambda a, b: a * b, row, column)) for column in columns] for row in A]
def turned(A: Matrix) -> Matrix:
    """The transpose of A."""
    return [list(column) for column in zip(*A)]
def combine(a: Any, A: Matrix, b: Any, B: Matrix) -> Matrix:
    """a A + b B."""
    return [[a * x + b * y for x, y in zip(row, other)] for row, other in zip(A, B)]
def diagonal(values: list[Any]) -> Matrix:
    """The matrix with these values on its diagonal."""
    return spread([[[value]] for value in values])
def square(A: Matrix) -> Fraction:
    """‖A‖² in the Frobenius norm."""
    return sum((x * x for row in A for x in row), Fraction(0))
def whole(A: Matrix) -> list[list[int]]:
    """A times the positive number that makes all entries whole."""
    factor = math.lcm(*(x.denominator for row in A for x in row))
    return [[int(x * factor) for x in row] for row in A]
def positive(A: Matrix) -> bool:
    """Whether A + Aᵀ is positive definite, by more than 2⁻⁷⁰⁰ of its diagonal: pivots of L D Lᵀ.

    Rows are scaled by powers of two, and numbers rounded down to multiples of 2⁻⁷²⁰. A symmetric
    error of less than 1 an entry moves no eigenvalue by more than n, which is taken off each time.
    """
    M, n = combine(1, A, 1, turned(A)), len(A)
    if any(M[k][k] <= 0 for k in range(n)):
        return False
    half = [(x.denominator.bit_length() - x.numerator.bit_length()) // 2
            for x in (M[k][k] for k in range(n))]
    N = [[math.floor(x * Fraction(2) ** (half[i] + half[j] + BITS)) for j, x in enumerate(row)]
         for i, row in enumerate(M)]
    while N:
        for k in range(len(N)):
            N[k][k] -= n
        (pivot, *row), *rest = N
        if pivot <= 0:
            return False
        N = [[x - left * y // pivot for x, y in zip(one, row)] for left, *one in rest]
    return True
def proof_claims(c: dict[str, Any], p: dict[str, Any], D: list[Fraction]) -> Iterator[Claim]:
    """What an instant's numbers claim: F is the law's, and d is dissipative with W = d Q."""
    n, edges, name = len(D), c["levels"], f"instant {p['instant']}"
    J, S = matrix(p["J_star"], edges[-1], n), matrix(p["stiffness"], edges[-1], edges[-1])
    F, G, d = matrix(p["F"], n, n), matrix(p["F_gravity"], n, n), number(p["delay_s"])
    certified = c["criterion"] == "certified"
    sizes = [n] if certified else [after - first for first, after in pairwise(edges)]
    W, Q = ([matrix(b, m, m) for b, m in zip(p[key], sizes, strict=True)] for key in ("W", "Q"))
    yield f"{name}: d is its bound", time(c["bounds_s"][p["instant"]]) == d > 0, ""
    F_q, (wide, multiplier) = times(turned(J), times(S, J)), (spread(W), spread(Q))
    if certified:
        F_q, loss, M = combine(1, F_q, -1, G), wide, F
        yield from _law(c, name, F, F_q, S)
    else:
        loss, M = times(turned(J), times(wide, J)), times(turned(J), S)
        yield f"{name}: F = JᵀSJ", square(combine(1, F, -1, F_q)) <= AGREE**2 * square(F), ""
        parts = [[row[a:b] for row in S[a:b]] for a, b in pairwise(edges)]
        yield f"{name}: S couples no levels", spread(parts) == S, ""
    close = square(combine(d, multiplier, -1, wide)) <= AGREE**2 * square(wide)
    yield f"{name}: W = d Q, symmetric", close and turned(wide) == wide, ""
    yield f"{name}: [[2D - loss, dM], [dMᵀ, W]] > 0", dissipates(2, D, loss, d, M, wide), ""
def spread(blocks: list[Matrix]) -> Matrix:
    """The matrix with these blocks on its diagonal."""
    n, rows, first = sum(map(len, blocks)), [], 0
    for one in blocks:
        after = n - first - len(one)
        rows += [[Fraction(0)] * first + row + [Fraction(0)] * after for row in one]
        first += len(one)
    return rows
def dissipates(factor: Any, D: list[Fraction], loss: Matrix, d: Any, M: Matrix, W: Matrix) -> bool:
    """Whether [[factor D − loss, d M], [d Mᵀ, W]] is positive definite."""
    corner, side = combine(factor, diagonal(D), -1, loss), combine(d, M, 0, M)
    upper, lower = zip(corner, side), zip(turned(side), W)
    return positive([a + b for a, b in (*upper, *lower)])

def _law(c: dict[str, Any], name: str, F: Matrix, F_q: Matrix, S: Matrix) -> Iterator[Claim]:
    """F is that of the fed-back signal, symmetric; S ⪰ 0; q̄(θ) contracts where it is fed back."""
    K = vector(c["spring_stiffness"], len(F))
    gap, size = combine(1, F, -1, F_q), square(F)
    if c["feedback"] == "static_joint":  # F = F_q + F K⁻¹ F_q
        gap = combine(1, gap, -1, times(F, [[x / k for x in row] for row, k in zip(F_q, K)]))
        size += square(F_q)
        both = all(positive(combine(1, diagonal(K), sign, F_q)) for sign in (-1, 1))
        yield f"{name}: q(theta) contracts, K - F_q and K + F_q > 0", both, ""
    yield f"{name}: F follows from J, S, K", square(gap) <= AGREE**2 * size, ""
    skew, even = square(combine(1, F, -1, turned(F))), square(combine(1, F, 1, turned(F)))
    most = min(number(c["asymmetry"]) * (1 + AGREE) + AGREE / 10**6, SYMMETRIC)
    yield f"{name}: F is symmetric to what is stated", skew <= most**2 * even, ""
    shift = AGREE * sum(S[i][i] for i in range(len(S))) + Fraction(1, 10**300)
    raised = combine(1, S, 1, diagonal([shift] * len(S)))
    yield f"{name}: S is positive semidefinite", positive(raised), ""

def shared_claims(c: dict[str, Any], D: list[Fraction]) -> Iterator[Claim]:
    """One multiplier for all proven instants, and one for all vertices of the windows."""
    n, d = len(D), time(c["common_multiplier_delay_s"])
    if d and d < math.inf:
        W, name = matrix(c["common_multiplier"], n, n), "common multiplier"
        good = all(dissipates(2, D, W, d, matrix(p["F"], n, n), W) for p in c["proofs"])
        yield f"{name} at {len(c['proofs'])} instants", good and turned(W) == W, ""
        if len(c["proofs"]) < c["instants"]:
            yield f"{name} elsewhere", None, "the matrices are not in the file"
    d, windows = time(c["time_varying_delay_s"]), c["time_varying_windows"]
    if not d or d == math.inf:
        return
    count, W = sum(2 ** min(len(w["axes"]), 60) for w in windows), c["time_varying_multiplier"]
    if count > MOST_VERTICES:
        yield "time-varying multiplier", None, f"{count} vertices are more than {MOST_VERTICES}"
        return
    W = matrix(W, n, n)
    good = all(_window(w, D, d, W) for w in windows) and turned(W) == W
    yield f"time-varying multiplier at {count} vertices with their balls", good, ""
    covered = 0
    for w in sorted(windows, key=lambda w: w["first"]):
        covered = max(covered, w["last"] + 1) if w["first"] <= covered else covered
    yield "windows cover the motion", covered == c["instants"], f"{covered} instants"
    inside = all(_inside(w, matrix(p["F"], n, n), D, d, W) for p in c["proofs"] for w in windows
                 if w["first"] <= p["instant"] <= w["last"])
    yield "windows hold the proven instants", inside, ""
    yield "windows hold the motion elsewhere", None, "its matrices are not in the file"
ROOT_2 = Fraction(math.isqrt(2 << 400), 1 << 200)  # from below
def _window(w: dict[str, Any], D: list[Fraction], d: Any, W: Matrix) -> bool:
    """(√2 − r)² in place of 2 at each vertex covers the ball of radius r around it."""
    n, r = len(D), number(w["radius"])
    centre, axes = matrix(w["centre"], n, n), [matrix(a, n, n) for a in w["axes"]]
    corners = [centre]
    for axis in axes:
        corners = [combine(1, corner, sign, axis) for corner in corners for sign in (-1, 1)]
    factor = (ROOT_2 - r) ** 2
    return 0 <= r < 1 and all(dissipates(factor, D, W, d, F, W) for F in corners)
def _inside(w: dict[str, Any], F: Matrix, D: list[Fraction], d: Any, W: Matrix) -> bool:
    """‖d D^-½ Δ W^-½‖ ≤ r says [[r² D, dΔ], [dΔᵀ, W]] ⪰ 0; Δ is F less a point of the box."""
    n, rest = len(D), combine(1, F, -1, matrix(w["centre"], len(D), len(D)))
    for values in w["axes"]:
        axis = matrix(values, n, n)
        weight = [[x / v for x in row] for row, v in zip(axis, D)]
        over = sum(x * y for r, s in zip(rest, weight) for x, y in zip(r, s))
        under = sum(x * y for r, s in zip(axis, weight) for x, y in zip(r, s))
        share = Fraction(float(max(-1, min(1, over / under)))) if under else 0
        rest = combine(1, rest, -share, axis)
    zero = [[Fraction(0)] * n for _ in range(n)]
    return dissipates((number(w["radius"]) + AGREE) ** 2, D, zero, d, rest, W)

def upper_claim(c: dict[str, Any], D: list[Fraction]) -> Claim:
    """No longer delay than the upper end d passes: d |y* F y| ≥ y* D y for the worst motion y."""
    name, upper = "no longer delay than the upper end", time(c["max_delay_upper_s"])
    found = next((p for p in c["proofs"] if p["instant"] == c["worst"]["instant"]), None)
    if found is None:
        return name, upper == time(c["max_delay_s"]) in (0, math.inf), "no bound to prove"
    F, (a, b) = matrix(found["F"], len(D), len(D)), matrix(c["worst_motion"], 2, len(D))
    power = sum(v * (x * x + y * y) for v, x, y in zip(D, a, b))
    Fa, Fb = (times(F, turned([v])) for v in (a, b))
    real = times([a], Fa)[0][0] + times([b], Fb)[0][0]
    imaginary = times([a], Fb)[0][0] - times([b], Fa)[0][0]
    enough = upper**2 * (real**2 + imaginary**2) * (1 + AGREE) ** 2 >= power**2 > 0
    shares = [v * (x * x + y * y) / power for v, x, y in zip(D, a, b)]
    stated = [number(c["worst"]["direction"][joint]) for joint in c["joints"]]
    near = all(abs(x - y) <= AGREE for x, y in zip(shares, stated))
    return name, enough and near and upper >= time(c["max_delay_s"]), f"{float(upper)} s"

def loop_claims(c: dict[str, Any]) -> Iterator[Claim]:
    """Rows of positions, roots without delay counted exactly, and the first crossing."""
    loop, modes = c["local_loop"], c["unstable_modes"]
    if loop is None:
        yield "unstable modes without delay", None, "no frozen loop is in the file"
        return
    states, s = loop["states"], len(loop["states"])
    A_0, A_1 = matrix(loop["A_0"], s, s), matrix(loop["A_1"], s, s)
    rows = [k for k, name in enumerate(states) if f"d/dt {name}" in states]
    rates = [[Fraction(other == f"d/dt {states[k]}") for other in states] for k in rows]
    same = [A_0[k] for k in rows] == rates and not any(any(A_1[k]) for k in rows)
    yield "positions change by their rates", same, f"{len(rows)} positions"
    V = loop["symmetries"]
    V = matrix(V, s, len(V[0])) if V else [[] for _ in states]
    lost = max(square(times(A, V)) / max(square(A), 1) for A in (A_0, A_1))
    yield "nothing acts along the symmetries", lost <= AGREE**2, f"to {float(lost) ** 0.5:.0e}"
    A_e = [[Fraction(0)] * s for _ in states]
    A_e = A_e if loop["A_e"] is None else matrix(loop["A_e"], s, s)
    parts = _quotient([combine(1, combine(1, A_0, 1, A_1), 1, A_e), A_1, A_e], V, states)
    name, A = "unstable modes without delay", parts[0]
    if loop["A_e"] is not None:
        yield name, None, "an embedded delay is left in the loop without d"
    else:
        found = unstable(polynomial(whole(A)))
        words = f"{found} roots right of the axis, {s - len(A)} by symmetry"
        yield name, True if found == modes else _near(A, modes), words
    yield _jitter_claim(c, loop, parts)
    words = "it is a root of a transcendental function; the first verifier excludes shorter delays"
    yield "first crossing and local margin", None, words
def _jitter_claim(c: dict[str, Any], loop: dict[str, Any], parts: list[Matrix]) -> Claim:
    """xᵀPx decreases: X - [R A, R L]ᵀ b X b [R A, R L] - [P A, P L] - its transpose > 0, P > 0."""
    name, claimed, proof = "jitter margin", time(c["jitter_margin_s"]), loop["jitter"]
    if proof is None:
        margin = time(c["instant_margins_s"][c["critical"]["instant"]])
        none = claimed is None or claimed == margin == 0
        free = claimed == margin == math.inf and not any(map(any, parts[1]))
        return name, none or free, ""
    d, k, S = number(proof["delay_s"]), len(parts[0]), number(loop["embedded_delay_s"])
    rows = [[i for i, row in enumerate(A) if any(row)] for A in parts[1:]]
    late = [i for at in rows for i in at]
    K = [[*row, *(Fraction(i == j) for j in late)] for i, row in enumerate(parts[0])]
    P, X = matrix(proof["P"], k, k), [matrix(proof[x], len(at), len(at)) for x, at in
                                      zip(("X", "X_e"), rows)]
    decrease = spread([[[Fraction(0)] * k for _ in range(k)], *X])
    for A, at, multiplier, bound in zip(parts[1:], rows, X, (d, S)):
        moved = times([A[i] for i in at], K)
        loss = times(turned(moved), times(multiplier, moved)) if at else []
        decrease = combine(1, decrease, -(bound**2), loss) if at else decrease
    power = times(P, K) + [[Fraction(0)] * len(decrease) for _ in late]
    even = all(turned(one) == one for one in (P, *X))
    first = time(c["first_crossing_s"])
    good = even and 0 < d == claimed and (first is None or d <= first)
    decreases = good and positive(P) and positive(combine(1, decrease, -2, power))
    return name, decreases, f"{float(d)} s, {k} states, {len(decrease) - k} late signals"
def _quotient(parts: list[Matrix], V: Matrix, states: list[str]) -> list[Matrix]:
    """A, A_1, A_e without symmetries v (A v = 0) and rates along them that last: A w = v, A_1 w =
    A_e w = 0. With x = v u + y, y_p = 0 at the largest entry p of v: y' = (A_i - v_i / v_p A_p) y.
    """
    columns, place = turned(V), {name: k for k, name in enumerate(states)}
    for v in list(columns):
        rate = [v[place[x[5:]]] if x[:5] == "d/dt " else Fraction(0) for x in states]
        A, *late = (times(A, turned([rate])) for A in parts)
        kept = sum(late, combine(1, A, -1, turned([v])))
        columns += [rate] if any(rate) and square(kept) <= AGREE**2 * square([v]) else []
    while columns:
        v, *columns = columns
        p = max(range(len(v)), key=lambda k: abs(v[k]))
        rest, ratio = [k for k in range(len(v)) if k != p], [x / v[p] for x in v]
        parts = [[[A[i][k] - ratio[i] * A[p][k] for k in rest] for i in rest] for A in parts]
        columns = [[w[i] - ratio[i] * w[p] for i in rest] for w in columns]
    return parts
def _near(A: Matrix, modes: int) -> bool | None:
    """False unless roots so near the axis that rounding moves them over it make the difference."""
    size = max(abs(x) for row in A for x in row) * Fraction(1, 10**12)
    shifted = [combine(1, A, sign, diagonal([size] * len(A))) for sign in (-1, 1)]
    low, high = (unstable(polynomial(whole(one))) for one in shifted)
    return None if low is None or high is None or low <= modes <= high else False
def polynomial(A: list[list[int]]) -> list[int]:
    """Coefficients of det(s − A), highest first, without any division (Berkowitz)."""
    result = [1]
    for k in range(len(A)):
        row, column = A[k][:k], [A[i][k] for i in range(k)]
        first = [1, -A[k][k]]
        for _ in range(k):
            first.append(-sum(map(int.__mul__, row, column)))
            column = [sum(map(int.__mul__, A[i][:k], column)) for i in range(k)]
        result = [sum(first[i - j] * result[j] for j in range(min(i, k) + 1)) for i in range(k + 2)]
    return result

DOWN, UP = (Context(DIGITS, way, -(10**9), 10**9) for way in (ROUND_FLOOR, ROUND_CEILING))
Interval = tuple[Decimal, Decimal]
def unstable(p: list[int]) -> int | None:
    """Roots with Re > 0: changes of sign down Routh's table of intervals; None if one holds 0."""
    rows = [[(DOWN.create_decimal(x), UP.create_decimal(x)) for x in p[k::2]] for k in (0, 1)]
    zero, heads = (Decimal(0), Decimal(0)), [1]
    for _ in range(len(p) - 1):
        above, below = rows
        if not below or below[0][0] <= 0 <= below[0][1]:
            return None
        heads.append(1 if below[0][0] > 0 else -1)
        q = _outward("divide", above[0], below[0])
        low = [_outward("multiply", q, y) for y in below[1:]] + [zero] * len(above)
        rows = [below, [_outward("subtract", x, y) for x, y in zip(above[1:], low)]]
    return sum(x != y for x, y in pairwise(heads))
def _outward(way: str, x: Interval, y: Interval) -> Interval:
    """All that multiply, divide or subtract makes of two intervals."""
    pairs = list(product(x, y))
    low, high = ([getattr(context, way)(a, b) for a, b in pairs] for context in (DOWN, UP))
    return min(low), max(high)

def motion_claims(c: dict[str, Any], D: list[Fraction]) -> Iterator[Claim]:
    """What is said of the whole motion is the smallest, or the worst, of its instants."""
    N, largest, worst, critical = c["instants"], time(c["max_delay_s"]), c["worst"], c["critical"]
    bounds, margins = ([time(v) for v in c[key]] for key in ("bounds_s", "instant_margins_s"))
    times_s, basis = vector(c["time_s"], N), c["instant_basis"]
    if not len(bounds) == len(margins) == len(basis) == N > 0:
        raise WrongInputError("bounds, margins and times are not as many as instants")
    good = all(v > 0 for v in D) and all(a < b for a, b in pairwise(times_s))
    yield "damping is positive, times increase", good, f"{N} instants"
    same = min(bounds) == largest == bounds[worst["instant"]] and largest >= 0
    yield "smallest bound, at the worst instant", same, f"{c['max_delay_s']} s"
    exact = [m for m, b in zip(margins, basis) if b == "exact"]
    smallest = min(exact, default=None)
    sound = all((m is None) == (b == "open") for m, b in zip(margins, basis)) and all(
        m == bound >= (smallest or 0) and m > 0 and c["criterion"] == "certified"
        for m, b, bound in zip(margins, basis, bounds) if b == "bound")
    sound &= all(m >= (smallest or 0) for m, b in zip(margins, basis) if b == "searched")
    same = time(c["local_margin_s"]) == smallest == margins[critical["instant"]]
    yield "smallest margin, at the critical instant", sound and same, f"{c['local_margin_s']} s"
    same = all(times_s[x["instant"]] == number(x["time_s"]) for x in (worst, critical))
    yield "times of both instants", same, ""
    stable = False if smallest == 0 else None if "open" in basis else True
    modes = c["unstable_modes"]
    rests = c["equilibrium"] is not None and c["equilibrium"]["found"]
    same = (modes > 0) == (smallest == 0) if rests else modes == 0 or smallest == 0
    yield "stability", c["stable"] is stable and same, f"{stable}"
    first = 0 if smallest == 0 else time(c["first_crossing_s"])
    yield "margin is the first crossing", smallest == first, ""
    both = 0 < (smallest or 0) < math.inf and 0 < largest < math.inf
    ratio = float(smallest or 0) / float(largest) if both else None
    yield "conservatism", c["conservatism"] == ratio, f"{ratio}"
    yield _verdict(c, largest)
def _verdict(c: dict[str, Any], largest: Any) -> Claim:
    """Passive if every bound covers the delay and no margin undercuts; certified if stable too."""
    d = number(c["delay_s"])
    shared = [time(c[key]) for key in c["left_open"] if key != "max_delay_s"]
    each = zip(c["instant_margins_s"], c["instant_basis"], c["bounds_s"])
    exact = [(time(m), time(bound)) for m, basis, bound in each if basis == "exact"]
    lost = any(0 < m <= d or (0 < m < b and c["criterion"] == "certified") for m, b in exact)
    passive = d <= min([largest, *shared]) and largest > 0 and not lost
    firm = c["stable"] is True and (c["equilibrium"] or {"found": True})["found"] is True
    status = ("certified" if firm else "passive_only") if passive else "not_certified"
    good = d >= 0 and c["status"] == status and bool(c["reasons"]) == (status != "certified")
    return "status follows", good, f"{c['status']} at {c['delay_s']} s"

def claims(c: dict[str, Any]) -> Iterator[Claim]:
    """Decide every claim of a certificate `c`, as `read` returns it."""
    D = vector(c["D_theta"], len(c["joints"]))
    rest = {**c, "hashes": {k: v for k, v in c["hashes"].items() if k != "content"}}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"), allow_nan=False)
    found = hashlib.sha256(text.encode()).hexdigest()
    yield "content is as written", found == c["hashes"]["content"], f"SHA-256 {found[:12]}"
    yield from motion_claims(c, D)
    proven = [p["instant"] for p in c["proofs"]]
    needed = 0 < time(c["max_delay_s"]) < math.inf
    yield "the worst instant is proven", not needed or c["worst"]["instant"] in proven, ""
    for p in c["proofs"]:
        yield from proof_claims(c, p, D)
    if len(set(proven)) < c["instants"]:
        yield "bounds of the other instants", None, "their matrices are not in the file"
    yield from shared_claims(c, D)
    yield upper_claim(c, D)
    yield from loop_claims(c)

def decided(path: str) -> list[Claim]:
    """Decide every claim of the file at `path`, or say in words why it is no certificate."""
    try:
        return list(claims(read(path)))
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        kinds = {WrongInputError: "", KeyError: "a key is missing: "}
        kind = kinds.get(type(error), "an entry is of another type or size: ")
        raise WrongInputError(f"{kind}{error}") from error
def main(path: str, show: Callable[[str], Any] = print) -> int:
    """Print one line for each claim of the file at `path` through `show`; return the status."""
    words = {True: "holds", False: "does not hold", None: "cannot decide"}
    try:
        found = decided(path)
    except WrongInputError as error:
        show(f"no certificate: {ascii(str(error))[:200]}")
        return 2
    for claim, holds, detail in found:
        show("".join(filter(str.isprintable, f"{words[holds]:14} {claim}: {detail}".rstrip(": "))))
    counts = [sum(holds is one for _, holds, _ in found) for one in words]
    show(f"{counts[0]} claims hold, {counts[1]} do not, {counts[2]} cannot be decided here")
    return 1 if counts[1] else 0

if __name__ == "__main__":
    sys.exit(main(sys.argv[1]) if len(sys.argv) == 2 else f"{__doc__}")
