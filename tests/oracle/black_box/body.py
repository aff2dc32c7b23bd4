"""Rigid bodies with locked and mimicking joints, and contacts that are held still.

Generalised coordinates are those of the actuated joints (and the base); the whole model's
velocities are T times theirs, so that M = Tᵀ M_whole T and g = Tᵀ g_whole.
"""

from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from oracle.black_box.design import Design

RANK = 1e-7
"""Smallest singular value of a contact Jacobian that counts, of the largest."""
BASE_NAME = "root_joint"


class Body:
    """A robot at rest: mass matrix, gravity, damping and contacts."""

    def __init__(self, design: Design) -> None:
        """Read the URDF.

        Args:
            design: names the URDF, the actuated joints, and the contacts.
        """
        text = design.urdf.read_text()
        mimics = _mimics(text)
        root = pin.JointModelFreeFlyer() if design.floating else None
        model = pin.buildModelFromXML(text, root) if root else pin.buildModelFromXML(text)
        self.model, self.data = model, model.createData()
        self.base = 6 if design.floating else 0
        movable = [name for name in list(model.names)[1:] if name != BASE_NAME]
        wanted = design.actuated
        self.joints = [
            j for j in movable if (j not in mimics if wanted is None else j in set(wanted))
        ]
        self.n, self.nv = len(self.joints), self.base + len(self.joints)
        self.nq = self.n + (7 if design.floating else 0)
        self._locked = pin.neutral(model)
        self._couplings = _couplings(movable, self.joints, mimics)
        self.T = self._coupling_matrix()
        self.damping = self.T.T @ np.diag(np.array(model.damping)) @ self.T
        self.falls_freely = design.floating and not design.contacts
        self.weight = 9.81 * sum(one.mass for one in list(model.inertias)[1:])
        at = [model.joints[model.getJointId(j)].idx_v for j in self.joints]
        self.efforts = np.array(model.effortLimit)[at]
        self.contacts = [(self._frame(name), rows) for name, rows in design.contacts]

    def _frame(self, name: str) -> int:
        if self.model.existFrame(name, pin.FrameType.BODY):
            return self.model.getFrameId(name, pin.FrameType.BODY)
        return [frame.name for frame in self.model.frames].index(name)

    def _coupling_matrix(self) -> np.ndarray:
        T = np.zeros((self.model.nv, self.nv))
        T[: self.base, : self.base] = np.eye(self.base)
        for name, (leader, ratio, _) in self._couplings.items():
            column = self.base + self.joints.index(leader)
            T[self.model.joints[self.model.getJointId(name)].idx_v, column] = ratio
        return T

    def whole(self, q: np.ndarray) -> np.ndarray:
        """Return the whole model's configuration at q (nq,)."""
        full = self._locked.copy()
        full[: self.nq - self.n] = q[: self.nq - self.n]
        for name, (leader, ratio, offset) in self._couplings.items():
            joint = self.model.joints[self.model.getJointId(name)]
            value = offset if leader is None else ratio * q[self._place(leader)] + offset
            if joint.nq == 2:  # a continuous joint: cosine and sine
                full[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
            else:
                full[joint.idx_q] = value
        return full

    def _place(self, joint: str) -> int:
        return self.nq - self.n + self.joints.index(joint)

    def posture(self, design: Design) -> np.ndarray:
        """Return the design's configuration (nq,)."""
        q = np.zeros(self.nq)
        if self.base:
            quaternion = np.array(design.base_quaternion)
            q[:3], q[3:7] = design.base_position, quaternion / np.linalg.norm(quaternion)
        for joint, value in design.joints.items():
            q[self._place(joint)] = value
        return q

    def move(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return q moved by a tangent vector (nv,), the base along its own axes."""
        out = q.copy()
        if self.base:
            placed = pin.XYZQUATToSE3(q[:7]) * pin.exp6(v[:6])
            out[:7] = pin.SE3ToXYZQUAT(placed)
        out[self.nq - self.n :] += v[self.base :]
        return out

    def mass(self, q: np.ndarray) -> np.ndarray:
        """Return M (nv, nv)."""
        M = pin.crba(self.model, self.data, self.whole(q))
        M = np.triu(M) + np.triu(M, 1).T
        return self.T.T @ M @ self.T

    def gravity(self, q: np.ndarray) -> np.ndarray:
        """Return the gravity torque g (nv,)."""
        return self.T.T @ pin.computeGeneralizedGravity(self.model, self.data, self.whole(q))

    def held(self, q: np.ndarray) -> tuple[np.ndarray, list[pin.SE3]]:
        """Return the contacts' Jacobian (c, nv), axes of the world, and their placements."""
        pin.computeJointJacobians(self.model, self.data, self.whole(q))
        pin.updateFramePlacements(self.model, self.data)
        rows, places = [np.zeros((0, self.nv))], []
        for frame, count in self.contacts:
            J = pin.getFrameJacobian(self.model, self.data, frame, pin.LOCAL_WORLD_ALIGNED)
            rows.append(J[:count] @ self.T)
            places.append(pin.SE3(self.data.oMf[frame]))
        return np.vstack(rows), places

    def free(self, q: np.ndarray, rank: int | None = None) -> np.ndarray:
        """Return an orthonormal basis (nv, k) of what the contacts leave free.

        Args:
            q: (nq,).
            rank: of the contact Jacobian, where it is known.
        """
        J, _ = self.held(q)
        if not len(J):
            return np.eye(self.nv)
        _, values, rows = np.linalg.svd(J, full_matrices=True)
        if rank is None:
            rank = int((values > RANK * values[0]).sum())
        return rows[rank:].T

    def touch(self, q: np.ndarray, places: list[pin.SE3]) -> np.ndarray:
        """Return the configuration near q at which the contacts are where they were."""
        for _ in range(20):
            J, now = self.held(q)
            away = [np.zeros(0)]
            for (_, rows), there, here in zip(self.contacts, places, now, strict=True):
                gap = np.zeros(6)
                gap[:3] = there.translation - here.translation
                gap[3:] = pin.log3(there.rotation @ here.rotation.T)
                away.append(gap[:rows])
            gap = np.concatenate(away)
            if not len(gap) or np.abs(gap).max() < 1e-14:
                break
            step = np.linalg.lstsq(J, gap, rcond=RANK)[0]
            q = self.move(q, step)
            if np.abs(step).max() < 1e-14:
                break
        return q

    def symmetries(self, q: np.ndarray) -> np.ndarray:
        """Return rigid motions (nv, s) that neither gravity nor a contact resists.

        Translations and the turn about the vertical as far as contacts allow them.
        """
        if not self.base:
            return np.zeros((self.nv, 0))
        R = pin.XYZQUATToSE3(q[:7]).rotation
        G = np.zeros((self.nv, 6))
        G[:3, :3] = R.T
        for k, axis in enumerate(np.eye(3)):
            G[3:6, 3 + k] = R.T @ axis
            G[:3, 3 + k] = R.T @ np.cross(axis, q[:3])
        G = G[:, [0, 1, 2, 5]]
        J, _ = self.held(q)
        _, values, rows = np.linalg.svd(J @ G, full_matrices=True)
        rank = int((values > RANK * max(values[0], 1e-300)).sum())
        return G @ rows[rank:].T


def _mimics(text: str) -> dict[str, tuple[str, float, float]]:
    """Leader, multiplier and offset of each joint that mimics another."""
    out = {}
    for joint in ElementTree.fromstring(text).iterfind("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            ratio, offset = mimic.get("multiplier", "1"), mimic.get("offset", "0")
            out[joint.get("name", "")] = (mimic.get("joint", ""), float(ratio), float(offset))
    return out


def _couplings(movable: list[str], joints: list[str], mimics: dict) -> dict:
    """Leader (None for a locked one), multiplier and offset of every joint that is not at 0."""
    out: dict[str, tuple[str | None, float, float]] = {name: (name, 1.0, 0.0) for name in joints}
    for name in movable:
        leader, ratio, offset = name, 1.0, 0.0
        while leader in mimics and leader not in joints:
            above, factor, more = mimics[leader]
            leader, ratio, offset = above, ratio * factor, offset + ratio * more
        if name not in out and leader in joints:
            out[name] = (leader, ratio, offset)
    return out
