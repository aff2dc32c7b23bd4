"""Small robots written as URDF: a wheel without gravity, and pendulums."""

from pathlib import Path

from sealag.robot import Robot, load_robot

_LINK = (
    '<link name="link{i}"><inertial><origin xyz="0 0 {com}"/><mass value="{mass}"/>'
    '<inertia ixx="{I}" iyy="{I}" izz="{I}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
_JOINT = (
    '<joint name="joint{i}" type="revolute"><parent link="{parent}"/><child link="link{i}"/>'
    '<origin xyz="0 0 {z}"/><axis xyz="{axis}"/>'
    '<limit lower="-100" upper="100" effort="1000" velocity="1000"/></joint>'
)


def chain(
    folder: Path,
    *,
    count: int = 1,
    axis: str = "0 1 0",
    mass: float = 1.0,
    inertia: float = 0.05,
    length: float = 0.5,
) -> Robot:
    """Return a fixed chain of equal links that hang from each other."""
    parts = ['<robot name="chain"><link name="base"/>']
    for i in range(count):
        parent, z = ("base", 0.0) if i == 0 else (f"link{i - 1}", -length)
        parts.append(_LINK.format(i=i, com=-length, mass=mass, I=inertia))
        parts.append(_JOINT.format(i=i, parent=parent, z=z, axis=axis))
    path = folder / "chain.urdf"
    path.write_text("".join(parts) + "</robot>")
    return load_robot(path, floating_base=False)


def wheel(folder: Path, *, inertia: float = 1.0) -> Robot:
    """Return one link of a given inertia on a vertical axis: no gravity, no coupling."""
    return chain(folder, axis="0 0 1", mass=1.0, inertia=inertia, length=0.0)
