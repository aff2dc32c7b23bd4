"""Robots with mimic joints, written as URDF: one of every kind, and random ones."""

_LINK = (
    '<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>'
    '<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0" iyz="0"/></inertial></link>'
)
_JOINT = (
    '<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
    '<origin xyz="{xyz}" rpy="0.1 0.2 0.3"/><axis xyz="{axis}"/>'
    '<limit lower="{lower}" upper="{upper}" effort="9" velocity="8"/>{more}</joint>'
)

_FREE = {"lower": -1e9, "upper": 1e9}


def link(name, *, com="0 0.1 0.1", mass=1.0):
    """Return a link."""
    return _LINK.format(name=name, com=com, mass=mass)


def joint(name, parent, child, *, kind="revolute", xyz="0.1 0 0.2", axis="0 1 0.5", lower=-3.0,
          upper=3.0, mimic=None, dynamics=None):  # fmt: skip
    """Return a joint; mimic is (joint, multiplier, offset), dynamics (damping, friction)."""
    more = ""
    if mimic is not None:
        of, multiplier, offset = mimic
        more = f'<mimic joint="{of}" multiplier="{multiplier}" offset="{offset}"/>'
    if dynamics is not None:
        more += f'<dynamics damping="{dynamics[0]}" friction="{dynamics[1]}"/>'
    return _JOINT.format(name=name, kind=kind, parent=parent, child=child, xyz=xyz, axis=axis,
                         lower=lower, upper=upper, more=more)  # fmt: skip


def robot(*parts):
    """Return a URDF."""
    return f'<robot name="r">{"".join(parts)}</robot>'


MIMICS = robot(
    link("base", mass=2),
    link("slider", mass=0.8),
    link("arm"),
    link("hand", mass=0.5, com="0.2 0 0.1"),
    link("left", mass=0.3),
    link("right", mass=0.4),
    joint("slide", "base", "slider", kind="prismatic", axis="1 0 0.2", mimic=("lead", -0.5, 0.1)),
    joint("lead", "slider", "arm", dynamics=(2.0, 0.5)),
    joint("chain", "arm", "hand", axis="1 1 0", mimic=("slide", 3.0, 0.2), dynamics=(1.0, 0.2)),
    joint("own", "hand", "left", axis="0 0 1", dynamics=(4.0, 0.0)),
    joint("beside", "hand", "right", axis="1 0 0", mimic=("own", -2.0, 0.0), dynamics=(0.5, 0.3)),
)
"""A slide that follows a joint behind it, a joint that follows the slide, one beside its leader."""


def random_mimics(rng):
    """Return the URDF of a random tree, and (leader, multiplier, offset) of each of its mimics.

    Leaders lie anywhere in the tree; chains of mimics are resolved.
    """
    count = int(rng.integers(2, 9))
    order, mimics, resolved = rng.permutation(count), {}, {}
    for place, k in enumerate(order[1:], start=1):
        if rng.random() < 0.5:
            of = f"j{order[rng.integers(place)]}"
            multiplier, offset = (round(float(x), 3) for x in rng.normal(size=2) * (1.0, 0.2))
            mimics[f"j{k}"] = of, multiplier, offset
            leader, m, o = resolved.get(of, (of, 1.0, 0.0))
            resolved[f"j{k}"] = leader, multiplier * m, multiplier * o + offset
    parts = [link("b0", mass=2)]
    for k in range(count):
        com, xyz, axis = (" ".join(map(str, x)) for x in rng.normal(size=(3, 3)).round(2) * 0.3)
        parts.append(link(f"b{k + 1}", com=com, mass=round(float(rng.uniform(0.3, 2.0)), 2)))
        kind = "revolute" if rng.random() < 0.6 else "prismatic"
        parts.append(joint(f"j{k}", f"b{rng.integers(k + 1)}", f"b{k + 1}", kind=kind, xyz=xyz,
                           axis=axis, **_FREE, mimic=mimics.get(f"j{k}")))  # fmt: skip
    return robot(*parts), resolved
