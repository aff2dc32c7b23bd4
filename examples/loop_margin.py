"""Exact delay margin of ẋ = A_0 x + A_1 x(t − d), and its rightmost roots on both sides of it.

One series elastic joint under delayed position feedback of its motor angle.
"""

import numpy as np

from sealag.margin import DelayedLoop

M, K, B_s, D_theta, F = 1.0, 350.0, 0.09, 10.0, 140.0
A_0 = np.array(
    [
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
        [-K / M, K / M, 0.0, 0.0],
        [K / B_s, -K / B_s, 0.0, -D_theta / B_s],
    ]
)
A_1 = np.zeros((4, 4))
A_1[3, 1] = -F / B_s

margin = DelayedLoop(A_0, A_1).margin(intervals=True)
print(f"margin {margin.delay * 1e3:.3f} ms, first crossing {margin.first_crossing * 1e3:.3f} ms")
for part in margin.intervals[:3]:
    print(f"{part.lower * 1e3:8.2f} to {part.upper * 1e3:8.2f} ms: {part.unstable_roots} unstable")
for share in (0.99, 1.01):
    roots = DelayedLoop(A_0, A_1).roots(delay=share * margin.delay)
    print(f"{share:.0%} of the margin: rightmost root {roots[0]:.3f} 1/s")
