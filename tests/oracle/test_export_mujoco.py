"""What MuJoCo makes of delays, and whether an exported design has its own delays there."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

import sealag
from helpers.designs import EXAMPLES
from helpers.mimics import joint, link, robot
from helpers.mujoco_export import Exported
from helpers.small_systems import arm, arm_system, constant_delays
from sealag.delay import Constant
from sealag.export import MujocoModel
from sealag.simulation import Clock, Foot, Network, Scene, closed_loop

STEP = 1e-3
JOINT = """<mujoco><option timestep="{step!r}" integrator="{integrator}" gravity="0 0 0"/>
<worldbody><body><joint name="j" axis="0 0 1"/>
<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body></worldbody>
<actuator><motor joint="j" {late}/></actuator></mujoco>"""


def arriving(late, *, step=STEP, integrator="implicitfast"):
    """Shares of a torque impulse by the steps after which they speed a joint up."""
    text = JOINT.format(step=step, integrator=integrator, late=late)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    found = {}
    for k in range(40):
        data.ctrl[0] = float(k == 20)
        before = data.qvel[0]
        mujoco.mj_step(model, data)
        share = round((data.qvel[0] - before) / step, 9)
        if share:
            found[k - 20] = share
    return found


def _lags(model, steps):
    """The steps by which the first motor's torque is late, from the 200th on.

    Torques grow by 2^-30 Nm a step, so that they move nothing and count exactly.
    """
    data, seen = mujoco.MjData(model), np.zeros(steps)
    for k in range(steps):
        data.ctrl[0] = k * 2.0**-30
        mujoco.mj_step(model, data)
        seen[k] = data.actuator_force[0] * 2.0**30
    return np.unique((np.arange(steps) - seen)[200:]).tolist()


class TestMujocoItself:
    """Facts of docs/theory section 15; if a version of MuJoCo changes them, the page is wrong."""

    def test_a_delay_of_whole_steps_is_kept(self):
        assert arriving('delay="0.003" nsample="3"') == {3: 1.0}
        assert arriving("") == {0: 1.0}

    def test_a_delay_between_steps_is_rounded_up(self):
        assert arriving('delay="0.0025" nsample="10"') == {3: 1.0}
        assert arriving('delay="0.0001" nsample="10"') == {1: 1.0}

    def test_linear_interpolation_splits_an_impulse_and_cubic_overshoots(self):
        assert arriving('delay="0.0025" nsample="9" interp="linear"') == {2: 0.5, 3: 0.5}
        weights = {1: -0.0625, 2: 0.5625, 3: 0.5625, 4: -0.0625}
        assert arriving('delay="0.0025" nsample="9" interp="cubic"') == weights

    @pytest.mark.parametrize("samples", [1, 2])
    def test_too_few_samples_silently_delay_less(self, samples):
        assert arriving(f'delay="0.003" nsample="{samples}"') == {samples: 1.0}

    def test_no_samples_are_refused(self):
        with pytest.raises(ValueError, match="without a history buffer"):
            arriving('delay="0.003"')

    def test_runge_kutta_lets_a_sixth_act_one_step_early(self):
        found = arriving('delay="0.005" nsample="5"', integrator="RK4")
        assert found == {4: pytest.approx(1 / 6), 5: pytest.approx(5 / 6)}

    def test_with_more_samples_than_steps_the_delay_jumps(self):
        def lags(samples, delay=0.012):
            late = f'delay="{delay}" nsample="{samples}"'
            text = JOINT.format(step=STEP, integrator="Euler", late=late)
            return _lags(mujoco.MjModel.from_xml_string(text), 20_000)

        assert lags(12) == [12]
        assert lags(13) == [12, 13]
        assert lags(16) == [12, 13]
        assert lags(16, delay=0.0115) == [12]

    def test_a_position_servo_s_own_feedback_is_not_late(self):
        """The same attribute is a command delay there: only the target waits."""
        servo = '<position joint="j" kp="30" kv="2" delay="0.005" nsample="5"/>'
        text = JOINT.format(step=STEP, integrator="Euler", late="")
        model = mujoco.MjModel.from_xml_string(text.replace('<motor joint="j" />', servo))
        data = mujoco.MjData(model)
        data.qpos[0], data.qvel[0] = 0.1, 0.5
        for k in range(20):
            data.ctrl[0] = 0.2 * k
            target = 0.2 * max(k - 5, 0)
            own = -30.0 * data.qpos[0] - 2.0 * data.qvel[0]
            mujoco.mj_step(model, data)
            assert data.actuator_force[0] == pytest.approx(30.0 * target + own, abs=1e-12)

    def test_sensordata_is_of_the_step_s_beginning(self):
        text = JOINT.format(step=STEP, integrator="Euler", late="")
        text = text.replace("</mujoco>", '<sensor><jointpos joint="j"/></sensor></mujoco>')
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        data.qvel[0] = 1.0
        for _ in range(9):
            before = data.qpos[0]
            mujoco.mj_step(model, data)
            assert data.sensordata[0] == before != data.qpos[0]
        mujoco.mj_step1(model, data)
        assert data.sensordata[0] == data.qpos[0]

    def test_after_a_reset_no_command_has_been_given(self):
        late = 'delay="0.003" nsample="3"'
        model = mujoco.MjModel.from_xml_string(
            JOINT.format(step=STEP, integrator="Euler", late=late)
        )
        data, forces = mujoco.MjData(model), []
        data.ctrl[0] = 2.0
        for _ in range(5):
            mujoco.mj_step(model, data)
            forces.append(data.actuator_force[0])
        assert forces == [0.0, 0.0, 0.0, 2.0, 2.0]


def _sliding(folder):
    """An arm with a sliding joint between two turning ones; its tool is a second branch."""
    path = folder / "sliding.urdf"
    path.write_text(
        robot(
            link("base"),
            *(link(name, mass=mass) for name, mass in (("a", 2.0), ("b", 1.5), ("c", 0.7))),
            link("tool", com="0.1 0 0.05", mass=0.4),
            joint("turn", "base", "a", axis="0 0.6 0.8"),
            joint("slide", "a", "b", kind="prismatic", axis="0.6 0 0.8"),
            joint("wrist", "b", "c"),
            joint("tool_turn", "a", "tool", axis="1 0 0"),
        )
    )
    return arm_system(
        folder,
        robot=sealag.load_robot(path, floating_base=False),
        posture=np.array([0.3, 0.1, -0.4, 0.2]),
        springs={"spring_stiffness": 400.0, "rotor_inertia": 0.1, "motor_damping": 9.0},
    )


@pytest.fixture(scope="module", params=["baxter", "anymal", "talos", "sliding"])
def exported(request, tmp_path_factory):
    if request.param == "sliding":
        system = _sliding(tmp_path_factory.mktemp("sliding"))
    else:
        system = sealag.load(EXAMPLES / f"{request.param}.toml")
    return Exported.of(system, MujocoModel.of(system))


class TestDelays:
    def test_each_commanded_torque_arrives_after_the_design_s_delay(self, exported):
        delays, steps = exported.system.delays, exported.file.steps
        down = delays.central.down.delay.upper_bound + delays.embedded.down.delay.upper_bound
        assert steps.command_delay == pytest.approx(down, abs=1e-12)
        model, data = exported.model, mujoco.MjData(exported.model)
        for k in range(20 + steps.command + 2):
            data.ctrl[:] = np.arange(1.0, model.nu + 1) * (k == 20)
            mujoco.mj_step(model, data)
            acts = k == 20 + steps.command
            np.testing.assert_array_equal(data.actuator_force, acts * np.arange(1.0, model.nu + 1))

    def test_the_delay_stays_after_many_steps(self, exported):
        count = exported.file.steps.command
        assert _lags(exported.model, 10_000) == [count]
        more = exported.file.text.replace(f'nsample="{count}"', f'nsample="{count + 1}"')
        assert _lags(mujoco.MjModel.from_xml_string(more), 10_000) == [count, count + 1]

    @pytest.mark.parametrize(("samples", "delay", "late"), [(-1, 0.0, -1), (4, 0.5, 1)])
    def test_other_settings_are_noticed(self, exported, samples, delay, late):
        """Controls: a sample too few is a step less, half a step more is a whole one."""
        steps = exported.file.steps
        before = f'delay="{steps.command_delay!r}" nsample="{steps.command}"'
        after = (
            f'delay="{steps.command_delay + delay * steps.step!r}" '
            f'nsample="{steps.command + samples}"'
        )
        assert before in exported.file.text
        model = mujoco.MjModel.from_xml_string(exported.file.text.replace(before, after))
        data, acted = mujoco.MjData(model), []
        for k in range(60):
            data.ctrl[0] = float(k == 20)
            mujoco.mj_step(model, data)
            acted += [k - 20] * bool(data.actuator_force[0])
        assert acted == [steps.command + late]

    def test_every_sensor_is_late_by_the_way_up(self, exported):
        steps, system = exported.file.steps, exported.system
        up = system.delays.central.up.delay.upper_bound
        assert steps.measurement_delay == pytest.approx(up, abs=1e-12)
        model, prompt = exported.model, exported.prompt
        data, twin = mujoco.MjData(model), mujoco.MjData(prompt)
        mujoco.mj_resetDataKeyframe(model, data, 0)
        rows = []
        for k in range(60):
            mujoco.mj_step1(model, data)
            twin.qpos[:], twin.qvel[:] = data.qpos, data.qvel
            mujoco.mj_forward(prompt, twin)
            rows.append(twin.sensordata.copy())
            if k >= steps.measurement:
                np.testing.assert_allclose(data.sensordata, rows[k - steps.measurement], atol=1e-12)
            mujoco.mj_step2(model, data)
        wrong = rows[59 - steps.measurement - 1]
        assert np.abs(data.sensordata - wrong).max() > 1e-6  # the control: a step more


class TestRobot:
    def test_masses_and_gravity_are_the_robot_s(self, exported):
        robot = exported.system.robot
        n, base = robot.n, robot.nv_base
        model, data = exported.model, mujoco.MjData(exported.model)
        q = robot.integrate(
            exported.system.posture, 0.3 * np.random.default_rng(3).standard_normal(robot.nv)
        )
        if base:
            data.qpos[:7] = [*q[:3], q[6], *q[3:6]]
        names = [model.joint(name) for name in robot.joints]
        for one, angle in zip(names, robot.joint_positions(q)):
            data.qpos[one.qposadr[0]] = angle
        mujoco.mj_forward(model, data)
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        order = [*range(base), *(one.dofadr[0] for one in names)]
        turn = np.eye(robot.nv)  # MuJoCo's base moves along the axes of the world
        if base:
            turn[:3, :3] = robot.frame_placement(robot.link_names()[0], q)[0]
        own = turn.T @ M[np.ix_(order, order)] @ turn
        np.testing.assert_allclose(own, robot.mass_matrix(q), atol=1e-9)
        weight = turn.T @ (data.qfrc_bias - data.qfrc_passive)[order]
        springs = data.qfrc_passive[order]
        assert np.abs(springs).max() > 1.0
        np.testing.assert_allclose(weight + turn.T @ springs, robot.gravity(q), atol=1e-8)
        rotors = M[-n:, -n:]
        np.testing.assert_allclose(
            rotors, np.diag(exported.system.actuators.shaped_inertia), rtol=1e-9
        )
        assert not np.allclose(rotors, np.diag(exported.system.actuators.shaped_inertia * 1.01))

    def test_the_keyframe_is_at_rest_once_the_past_is_filled(self, exported):
        seen = exported.start()
        mujoco.mj_forward(exported.model, exported.data)
        assert np.abs(exported.data.qacc).max() > 10.0  # the control: no command has arrived
        exported.fill(seen, exported.data.ctrl.copy())
        mujoco.mj_forward(exported.model, exported.data)
        assert np.abs(exported.data.qacc).max() < 0.3  # rad/s²; contacts are stiff, not rigid


class TestClosedLoop:
    """Two joints with unequal springs, the design's own controller, and both ways late."""

    moved, rotors, duration = np.array([0.2, -0.1]), np.array([0.15, -0.12]), 0.4

    @pytest.fixture
    def system(self, tmp_path):
        delays = constant_delays(0.004, 0.003, 0.004, sample_time=0.002)
        springs = {
            "spring_damping": np.array([0.4, 0.2]),
            "viscous_friction": np.array([0.5, 0.3]),
        }
        two = arm(tmp_path, damping=(0.6, 0.3))
        return arm_system(tmp_path, robot=two, delays=delays, springs=springs)

    def _ours(self, system, delays):
        rest = system.rest()
        run = closed_loop(
            system.robot,
            system.actuators,
            system.controller(),
            q=rest.q + self.moved,
            v=np.zeros(2),
            theta=rest.theta + self.rotors,
            theta_dot=np.zeros(2),
            duration=self.duration,
            network=Network.from_delays(delays),
            clock=Clock(physics=2e-4, central=delays.sample_time),
        )
        places = np.hstack([run.q, run.theta])
        return run, places[: round(self.duration / delays.sample_time)]

    def _theirs(self, system, step):
        file = MujocoModel.of(system, step=step)
        there = Exported.of(system, file)
        places = there.run(system.controller(), self.duration, moved=self.moved, rotors=self.rotors)
        return file, places[:: file.steps.tick]

    def test_moves_as_the_simulator_says(self, system):
        run, exact = self._ours(system, system.delays)
        file, coarse = self._theirs(system, 1e-4)
        _, fine = self._theirs(system, 5e-5)
        assert file.steps.total == pytest.approx(run.ages.total)
        assert file.steps.total == pytest.approx(system.delays.d_1)
        # MuJoCo is of first order: errors halve, and their extrapolation has almost none: 9e-8
        # rad of second order. A bound a hundred times larger would not see 0.1 ms.
        assert np.abs(coarse - exact).max() / np.abs(fine - exact).max() == pytest.approx(
            2, abs=0.05
        )
        limit = 2.0 * fine - coarse
        apart = np.abs(limit - exact).max()
        late = constant_delays(0.004, 0.003, 0.0042, sample_time=0.002)
        _, wrong = self._ours(system, late)  # the control: commands 0.1 ms later
        print(apart, np.abs(limit - wrong).max())
        assert apart < 3e-7
        assert np.abs(limit - wrong).max() > 100.0 * apart

    def test_is_stable_below_the_sampled_margin_and_not_above(self, tmp_path):
        """The margin of the held loop is found again: 3 % less decays, 3 % more grows."""
        period = 0.01
        prompt = constant_delays(0.0, 0.0, sample_time=period)
        loop = arm_system(tmp_path, delays=prompt).frozen()
        margin = loop.sampled_margin(period=period).delay
        assert margin is not None
        for share in (0.97, 1.03):
            late = constant_delays(0.0, round(share * margin, 4), sample_time=period)
            system = arm_system(tmp_path, delays=late)
            there = Exported.of(system, MujocoModel.of(system, step=1e-4))
            places = there.run(system.controller(), 40.0, moved=0.05)
            swing = [np.ptp(part, axis=0).max() for part in np.array_split(places, 4)]
            print(margin, share, swing)
            assert (swing[3] < 0.5 * swing[0]) if share < 1.0 else (swing[3] > 2.0 * swing[0])


def test_a_quadruped_on_held_feet_moves_as_the_simulator_says():
    """ANYmal, its rotors moved by 0.01 rad: base sensors, contacts and the hold of 2.5 ms."""
    system = sealag.load(EXAMPLES / "anymal.toml")
    scene = Scene(feet=[Foot(contact=contact, friction=2.0) for contact in system.contacts])
    system = replace(system, posture=scene.touching_posture(system.robot, system.posture))
    rest, n, duration = system.rest(), system.robot.n, 0.15
    moved = 0.01 * np.random.default_rng(5).standard_normal(n)

    def ours(delays):
        run = closed_loop(
            system.robot,
            system.actuators,
            system.controller(),
            q=rest.q,
            v=np.zeros(system.robot.nv),
            theta=rest.theta + moved,
            theta_dot=np.zeros(n),
            duration=duration,
            network=Network.from_delays(delays),
            clock=Clock(physics=2.5e-4, central=system.delays.sample_time),
            scene=scene,
        )
        return np.hstack([system.robot.joint_positions(run.q), run.theta])[:-1]

    def theirs(step):
        there = Exported.of(system, MujocoModel.of(system, step=step))
        places = there.run(system.controller(), duration, rotors=moved)
        return places[:: there.file.steps.tick, 7:]

    exact = ours(system.delays)
    limit = 2.0 * theirs(1.25e-4) - theirs(2.5e-4)
    apart = np.abs(limit - exact).max()
    later = replace(system.delays, central=Constant(0.016))  # the control: each way 4 ms later
    wrong = np.abs(limit - ours(later)).max()
    print(np.ptp(exact, axis=0).max(), apart, wrong)
    assert apart < 2e-5  # rad, of 0.013; MuJoCo's feet give way a little
    assert wrong > 10.0 * apart
