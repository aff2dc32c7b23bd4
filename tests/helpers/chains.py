"""Small robots written as URDF: a wheel without gravity, and pendulums."""

from pathlib import Path

from sealag.robot import Robot, load_robot

_LINK = (
    '<link name="link{i}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>'
    '<inertia ixx="{I}" iyy="{I}" izz="{I}" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)
_JOINT = (
    '<joint name="joint{i}" type="revolute"><parent link="{parent}"/><child link="link{i}"/>'
    '<origin xyz="{place}"/><axis xyz="{axis}"/>'
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
    along: str = "z",
) -> Robot:
    """Return a fixed chain of equal links that hang (along z) or lie (along x) end to end."""

    def offset(distance: float) -> str:
        return f"0 0 {-distance}" if along == "z" else f"{distance} 0 0"

    parts = ['<robot name="chain"><link name="base"/>']
    for i in range(count):
        parent, place = ("base", offset(0.0)) if i == 0 else (f"link{i - 1}", offset(length))
        parts.append(_LINK.format(i=i, com=offset(length), mass=mass, I=inertia))
        parts.append(_JOINT.format(i=i, parent=parent, place=place, axis=axis))
    path = folder / "chain.urdf"
    path.write_text("".join(parts) + "</robot>")
    return load_robot(path, floating_base=False)


def wheel(folder: Path, *, inertia: float = 1.0) -> Robot:
    """Return one link of a given inertia on a vertical axis: no gravity, no coupling."""
    return chain(folder, axis="0 0 1", mass=1.0, inertia=inertia, length=0.0)


def planar_arm(folder: Path, *, count: int, mass: float, inertia: float, length: float) -> Robot:
    """Return links in a horizontal plane: coupled inertia, no gravity."""
    return chain(
        folder,
        count=count,
        axis="0 0 1",
        mass=mass,
        inertia=inertia,
        length=length,
        along="x",
    )


class Damped:
    """A robot whose joints are damped on the links' side as given (n,), Nms/rad."""

    def __init__(self, robot: Robot, damping) -> None:
        self._robot, self.damping = robot, damping

    def __getattr__(self, name: str):
        return getattr(self._robot, name)
