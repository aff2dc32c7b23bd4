"""Small random robots: trees of one to four joints with damping, sliders and mimics."""

import numpy as np


def random_urdf(rng: np.random.Generator, most: int = 4) -> str:
    """Return the text of a random URDF.

    Args:
        rng: decides everything.
        most: joints.
    """
    count = int(rng.integers(1, most + 1))
    damped, mimic = rng.random() < 0.35, rng.random() < 0.2 and count > 1
    limited = rng.random() < 0.5
    parts = ['<robot name="own">', _link("base", rng)]
    for k in range(count):
        parent = "base" if k == 0 else f"link{int(rng.integers(max(0, k - 2), k))}"
        sliding = rng.random() < 0.2
        parts.append(_link(f"link{k}", rng))
        more = ""
        if damped:
            more += f'<dynamics damping="{float(np.exp(rng.uniform(-3, 1.5))):.6f}"/>'
        if mimic and k == count - 1 and not sliding:
            ratio, offset = rng.uniform(-1.5, 1.5), rng.uniform(-0.5, 0.5)
            more += f'<mimic joint="joint0" multiplier="{ratio:.4f}" offset="{offset:.4f}"/>'
        kind = "prismatic" if sliding else ("revolute" if limited or more else "continuous")
        axis = rng.normal(size=3) if rng.random() < 0.3 else np.eye(3)[int(rng.integers(3))]
        axis = axis / np.linalg.norm(axis)
        xyz = rng.normal(size=3) * 0.1 - np.array([0.0, 0.0, 0.3])
        rpy = rng.normal(size=3) * 0.3
        parts.append(
            f'<joint name="joint{k}" type="{kind}"><parent link="{parent}"/>'
            f'<child link="link{k}"/><origin xyz="{_triple(xyz)}" rpy="{_triple(rpy)}"/>'
            f'<axis xyz="{_triple(axis)}"/>'
            f'<limit lower="-3" upper="3" effort="100000" velocity="1000"/>{more}</joint>'
        )
        tip = rng.normal(size=3) * 0.15 - np.array([0.0, 0.0, 0.3])
        parts.append(_fixed(f"link{k}", f"tip{k}", tip))
    for k in range(3):
        parts.append(_fixed("base", f"foot{k}", rng.normal(size=3) * 0.2))
    parts.append("</robot>")
    return "\n".join(parts)


def _link(name: str, rng: np.random.Generator) -> str:
    mass = float(np.exp(rng.uniform(-0.7, 1.5)))
    root = rng.normal(size=(3, 3)) * 0.15
    spread = mass * (root @ root.T + 0.01 * np.eye(3))  # second moments: any SPD matrix is a body
    J = np.trace(spread) * np.eye(3) - spread
    com = rng.normal(size=3) * 0.05 - np.array([0.0, 0.0, 0.15])
    return (
        f'<link name="{name}"><inertial><origin xyz="{_triple(com)}"/><mass value="{mass:.6f}"/>'
        f'<inertia ixx="{J[0, 0]:.9f}" ixy="{J[0, 1]:.9f}" ixz="{J[0, 2]:.9f}" '
        f'iyy="{J[1, 1]:.9f}" iyz="{J[1, 2]:.9f}" izz="{J[2, 2]:.9f}"/></inertial></link>'
    )


def _fixed(parent: str, child: str, xyz: np.ndarray) -> str:
    return (
        f'<link name="{child}"/><joint name="to_{child}" type="fixed"><parent link="{parent}"/>'
        f'<child link="{child}"/><origin xyz="{_triple(xyz)}"/></joint>'
    )


def _triple(values: np.ndarray) -> str:
    return " ".join(f"{float(v):.6f}" for v in values)
