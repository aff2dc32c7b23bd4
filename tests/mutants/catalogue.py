"""The mutants: what is changed, what it falsifies, and which tests cover the place."""

from dataclasses import dataclass

TESTS = {
    "delay": "tests/unit/test_delay_link.py tests/unit/test_actuation_delay.py "
             "tests/unit/test_design_network.py tests/unit/test_simulation_exchange.py",
    "actuation": "tests/unit/test_actuation_delay.py tests/unit/test_actuation_of_robot.py "
                 "tests/unit/test_whole_body_frozen.py "
                 "tests/reference/test_kernels_motor.py",
    "law": "tests/unit/test_whole_body_spaces.py tests/unit/test_whole_body_frozen.py "
           "tests/unit/test_whole_body_law.py tests/unit/test_whole_body_signals.py "
           "tests/unit/test_whole_body_rest.py tests/unit/test_whole_body_tank.py "
           "tests/unit/test_whole_body_controller.py tests/unit/test_design_cases.py "
           "tests/oracle/test_black_box_corpus.py",
    "margin": "tests/unit/test_margin_delay_margin.py tests/unit/test_design_drift.py "
              "tests/unit/test_margin_slow_crossings.py "
              "tests/unit/test_margin_embedded_delay.py tests/unit/test_margin_at_most.py "
              "tests/unit/test_margin_bad_input.py tests/oracle/test_margin_known_systems.py "
              "tests/property/test_margin_never_exceeded.py",
    "passivity": "tests/unit/test_passivity_bounds.py tests/unit/test_passivity_storage.py "
                 "tests/unit/test_passivity_motion.py tests/unit/test_passivity_windows.py "
                 "tests/unit/test_passivity_verify.py tests/unit/test_certificate_forgeries.py "
                 "tests/unit/test_certificate_local.py tests/unit/test_certificate_edges.py "
                 "tests/unit/test_certificate_drives.py tests/oracle/test_passivity_multitask.py "
                 "tests/oracle/test_passivity_against_sdp.py",
    "design": "tests/unit/test_design_local.py tests/unit/test_design_motors.py "
              "tests/unit/test_design_thresholds.py tests/unit/test_design_conditions.py "
              "tests/unit/test_design_withdrawn.py "
              "tests/unit/test_simulation_scenario_settings.py "
              "tests/unit/test_design_cases.py "
              "tests/unit/test_design_questions.py tests/unit/test_design_system.py "
              "tests/unit/test_design_starter.py tests/unit/test_design_drift.py "
              "tests/meta/test_no_silent_key.py tests/cli/test_cli_certify.py "
              "tests/cli/test_cli_bad_input.py tests/cli/test_cli_margin.py",
    "simulation": "tests/unit/test_simulation_scenario_settings.py "
                  "tests/unit/test_simulation_energy.py tests/unit/test_simulation_exchange.py "
                  "tests/unit/test_simulation_damping.py tests/unit/test_simulation_ground.py "
                  "tests/unit/test_simulation_scenes.py tests/oracle/test_simulation_analytic.py "
                  "tests/oracle/test_simulation_quadrature.py tests/unit/test_passivity_storage.py "
                  "tests/unit/test_design_network.py",
    "walking": "tests/unit/test_walking_plan.py tests/unit/test_walking_controller.py "
               "tests/reference/test_kernels_walking.py",
    "robot": "tests/unit/test_robot_urdf.py tests/oracle/test_robot_against_mujoco.py "
             "tests/oracle/test_robot_mimic.py tests/unit/test_design_cases.py",
    "files": "tests/unit/test_files.py tests/unit/test_report_mcap.py "
             "tests/cli/test_cli_outputs.py",
    "cli": "tests/cli/test_cli_terminal.py tests/cli/test_cli_status.py "
           "tests/cli/test_cli_certify.py tests/cli/test_cli_simulate.py",
    "units": "tests/unit/test_units.py tests/unit/test_design_starter.py",
}  # fmt: skip
"""Tests of each room, those that are quick first."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """One change.

    Attributes:
        room: key of TESTS.
        file: below src/sealag.
        old: text that stands there once.
        new: what replaces it.
        falsifies: the answer that is wrong then.
        same: why no test can notice it; empty if one must.
    """

    room: str
    file: str
    old: str
    new: str
    falsifies: str
    same: str = ""


def _of(room: str, file: str, *changes: tuple[str, ...]) -> list[Mutant]:
    return [Mutant(room, file, *change) for change in changes]


MUTANTS = [
    *_of(
        "delay", "delay/_delays.py",
        ("return up + self.embedded_period + self.d_2", "return up + self.d_2",
         "d_1 without the wait for the embedded exchange"),
        ("self.central.up.late_bound(self.embedded_period or self.sample_time)",
         "self.central.up.late_bound(self.sample_time)",
         "a burst upwards counted at the controller's period"),
        ("down = self.central.down.late_bound(self.sample_time)",
         "down = self.central.down.late_bound(self.embedded_period or self.sample_time)",
         "a burst downwards counted at the embedded period"),
        ("down + drive + self.sample_time + 2.0 * self.embedded_period",
         "down + drive + self.sample_time + self.embedded_period", "one wait of two"),
        ("down + drive + self.sample_time + 2.0 * self.embedded_period",
         "down + drive + 2.0 * self.embedded_period", "the controller's hold left out"),
        ("drive += self.central.down.spread", "drive += self.central.down.jitter",
         "overtaking by a falling delay left out"),
        ("jitter=factor * link.jitter", "jitter=link.jitter", "scaled delays, unscaled jitter"),
        ("return self.embedded.up.late_bound(period) + 2.0 * self.embedded_period",
         "return self.embedded.up.late_bound(period)", "age of late torque feedback"),
        ("half = Share(signal=signal, fraction=0.5)", "half = Share(signal=signal, fraction=1.0)",
         "a round trip counted twice"),
        ("return self.up.delay.mean + self.down.delay.mean",
         "return self.up.delay.mean", "mean of a round trip"),
        ("return self.up.delay.at(t) + self.down.delay.at(t)", "return 2.0 * self.up.delay.at(t)",
         "a round trip of unlike ways"),
        ("sample_time=self.sample_time or self.embedded_period or UNSTATED_PERIOD",
         "sample_time=self.sample_time or UNSTATED_PERIOD", "period of an unstated controller"),
        ("if self.d_1 > LONGEST_DELAY_S:", "if self.d_2 > LONGEST_DELAY_S:",
         "delays that are too long together"),
    ),
    *_of(
        "delay", "delay/_link.py",
        ("return self.delay.upper_bound + self.jitter + self.overtaken + lost * period",
         "return self.delay.upper_bound + self.overtaken + lost * period", "jitter in d_1"),
        ("return self.delay.upper_bound + self.jitter + self.overtaken + lost * period",
         "return self.delay.upper_bound + self.jitter + lost * period", "overtaking in d_1"),
        ("lost = self.max_burst if self.loss > 0 else 0",
         "lost = self.max_burst - 1 if self.loss > 0 else 0", "bursts in d_1"),
        ("return self.jitter + self.delay.upper_bound - self.delay.lower_bound",
         "return self.jitter", "spread of a varying delay"),
        ("min(self.spread, self.jitter / closing)", "self.jitter / closing",
         "a bound of overtaking beyond the spread"),
        ("if self.order != PacketOrder.ARRIVAL:\n            return 0.0",
         "if self.order == PacketOrder.FIFO:\n            return 0.0",
         "newest packets that count as overtaken"),
        ("if run > self.max_burst:", "if run > self.max_burst + 1:", "bursts that are too long"),
        ("arrival = np.maximum.accumulate(arrival)\n        arrival[lost] = np.inf",
         "pass\n        arrival[lost] = np.inf", "packets of a queue that overtake"),
        ("return sent if self.order == PacketOrder.ARRIVAL else np.maximum.accumulate(sent)",
         "return sent", "measurements that grow older"),
        ("jitter[rest] = self.jitter * rng.random(_BLOCK)[:size]",
         "jitter[rest] = 0.5 * self.jitter * rng.random(_BLOCK)[:size]", "half of the jitter"),
        ("early = middle + self.delay.at(middle) + jitter <= looks",
         "early = middle + self.delay.at(looks) + jitter <= looks",
         "delay at the look instead of at sending"),
    ),
    *_of(
        "delay", "delay/_signal.py",
        ("return self.mean + self.amplitude\n", "return self.mean\n", "bound of a sinusoid"),
        ("return self.mean - self.amplitude\n", "return self.mean\n", "least of a sinusoid"),
        ("return self.amplitude * abs(self.angular_frequency)",
         "return self.amplitude * self.angular_frequency", "fall of a sinusoid that runs back"),
        ("np.sin(self.angular_frequency * t + self.phase)",
         "np.sin(self.angular_frequency * t)", "phase of a sinusoid"),
        ("return float(np.max(-slopes, initial=0.0))", "return float(np.max(slopes, initial=0.0))",
         "fall of a table"),
        ("left_out=float(np.mean(values > cut))", "left_out=0.0", "packets beyond the quantile"),
        ("delay=np.minimum(values, cut)", "delay=values", "a quantile that cuts nothing"),
        ("return self.fraction * self.signal.steepest_fall", "return self.signal.steepest_fall",
         "fall of a share"),
        ("return float(area / (self.time[-1] - self.time[0]))", "return float(self.delay.mean())",
         "mean of an uneven table"),
    ),
    *_of(
        "actuation", "actuation/_actuators.py",
        ("ratio=own(self.rotor_inertia / self.shaped_inertia)",
         "ratio=own(self.shaped_inertia / self.rotor_inertia)", "shaping upside down"),
        ("viscous=own(self.viscous_friction)", "viscous=own(0.0)", "viscous friction"),
        ("bearing=own(joint_damping)", "bearing=own(0.0)", "damping of the links' bearings"),
        ("moving = np.where(robot.velocity_limit > 0.0, robot.velocity_limit, np.inf)",
         "moving = robot.velocity_limit", "a speed limit of 0"),
        ('("coulomb_friction", robot.friction),', '("coulomb_friction", 0.0 * robot.friction),',
         "friction of the URDF"),
        ("filled[name] = np.where(np.isnan(given), own, given)", "filled[name] = own",
         "limits that the user states"),
        ("shaped_inertia=shaping * taken[\"rotor_inertia\"]",
         "shaped_inertia=taken[\"rotor_inertia\"] / shaping", "B_s"),
    ),
    *_of(
        "actuation", "actuation/_transparency.py",
        ("half = D**2 / (2.0 * B_s**2) - K / B_s", "half = D**2 / (2.0 * B_s**2) + K / B_s",
         "bandwidth"),
        ("np.exp(-s * delay)", "np.exp(s * delay)", "phase lag of the delay"),
        ("damping_ratio=D / (2.0 * np.sqrt(K * B_s))", "damping_ratio=D / np.sqrt(K * B_s)",
         "damping ratio"),
    ),
    *_of(
        "law", "whole_body/_spaces.py",
        ("F_q = F_task - F_gravity", "F_q = F_task + F_gravity", "sign of gravity's gradient"),
        ("F_q = F_task - F_gravity", "F_q = F_task", "gravity that is fed back"),
        ("F_task = J_star.transpose(0, 2, 1) @ S @ moved",
         "F_task = J_star.transpose(0, 2, 1) @ S @ J_star", "plain task errors"),
        ("contraction=static_contraction(F_q, K)", "contraction=static_contraction(F_task, K)",
         "contraction with fed-back gravity"),
        ("asymmetry=Spaces.relative_asymmetry(F_theta)",
         "asymmetry=Spaces.relative_asymmetry(F_q)",
         "asymmetry on the motors' side"),
        ("lost |= (here < _ranks(robot, there, levels)).any(axis=1)",
         "lost |= (here < _ranks(robot, there, levels)).all(axis=1)", "singular postures"),
        ("star=law.task_inertia is TaskInertia.LAMBDA_STAR", "star=False", "Λ* of (10)"),
    ),
    *_of(
        "law", "whole_body/_signals.py",
        ("loop = np.swapaxes(np.eye(len(K)) - F_q / K[:, None], -1, -2)",
         "loop = np.swapaxes(np.eye(len(K)) - F_q / K[None, :], -1, -2)",
         "springs that differ from joint to joint"),
        ("loop = np.swapaxes(np.eye(len(K)) - F_q / K[:, None], -1, -2)",
         "loop = np.swapaxes(np.eye(len(K)) + F_q / K[:, None], -1, -2)",
         "series of law and spring"),
        ("return np.linalg.norm(F_q / root[:, None] / root, ord=2, axis=(-2, -1))",
         "return np.linalg.norm(F_q / K[:, None], ord=2, axis=(-2, -1))", "contraction factor"),
        ("bad = ~(contraction < 1.0)", "bad = ~(contraction < 10.0)", "tasks stiffer than springs"),
        ("if self.flow is TankFlow.PUBLISHED:", "if False:", "the printed tank is certified"),
    ),
    *_of(
        "law", "whole_body/_links.py",
        ("out -= at.frame_jacobian(contact.frame)[: last - first].T @ force[first:last]",
         "first = last; continue", "contact forces in the links' stiffness"),
        ("H = others @ ((H + H.T) / 2.0) @ others", "H = (H + H.T) / 2.0", "rigid motions"),
        ("G[3:6, 3] = R.T[:, 2]", "G[3:6, 3] = R[:, 2]",
         "turn about the vertical of a base that leans"),
        ("left[self._robot.nv_base :] -= springs\n        return np.linalg.lstsq",
         "pass\n        return np.linalg.lstsq", "what springs carry"),
        ("Z.T @ self._robot.mass_matrix(q) @ Z", "np.eye(Z.shape[1])", "inertia of free motions"),
    ),
    *_of(
        "law", "whole_body/_frozen.py",
        ("spring += actuators.spring_damping[:, None] * (rate - link_rate)", "pass",
         "damping beside the spring"),
        ("S.T @ (spring - drag) - at.take(at.z, H)", "S.T @ spring - at.take(at.z, H)",
         "damping of the links' bearings"),
        ("S.T @ (spring - drag) - at.take(at.z, H)", "S.T @ (spring - drag)",
         "stiffness of gravity and contacts"),
        ("A_e = B @ (rows.shift[:, None] * spring) if late else np.zeros_like(A_0)",
         "A_e = np.zeros_like(A_0)", "late torque feedback"),
        ("A_0[at.memory, at.theta_rate] = memory.B_rate", "pass", "x̂ that moves with the motors"),
        ("shift=(1.0 - ratio) / ratio", "shift=1.0 - ratio", "gain of late torque feedback"),
    ),
    *_of(
        "law", "whole_body/_tank.py",
        ("return self._first > 0.0 and self.rate > 0.0", "return False", "a tank that can pay"),
        ("self._energy[0], self._started[0] = self._first, 0", "self._started[0] = 0",
         "a tank that is filled at the start"),
    ),
    *_of(
        "law", "whole_body/_signal_states.py",
        ("A=-rate * np.eye(m), B_q=rate * T_q", "A=-rate * np.eye(m), B_q=-rate * T_q",
         "derivative of the tank"),
        ("return carried / self._law.spring_stiffness if self._links else np.zeros_like(carried)",
         "return np.zeros_like(carried)", "where link angles let springs rest"),
        ("energy -= 0.5 * float(out @ (out / self._law.spring_stiffness))", "pass",
         "potential of q̄(θ)"),
        ("for h, share in ((width / 2.0, 4.0 / 3.0), (width, -1.0 / 3.0)):",
         "for h, share in ((width / 2.0, 2.0 / 3.0), (width, 1.0 / 3.0)):",
         "extrapolated differences: accuracy only"),
    ),
    *_of(
        "margin", "margin/_margin.py",
        ("drifting = int((roots.real > -_DRIFT).sum())",
         "drifting = int((roots.real > _DRIFT).sum())", "zero roots by rounding"),
        ("return delay * crossing.frequency < 1e-9", "return delay * crossing.frequency < 1e-3",
         "a slow crossing taken for a zero root"),
        ("delay=0.0 if unstable else first", "delay=first", "margin of an unstable loop"),
        ("if crossing.direction < 0:\n        return None",
         "if crossing.direction < 0:\n        return crossing.delay",
         "roots that come back counted as lost"),
        ("return crossing.delay + crossing.period\n", "return crossing.delay\n",
         "an undamped root that leaves at once"),
        ("lower, unstable = delay, unstable + 2 * direction",
         "lower, unstable = delay, unstable + direction", "unstable roots of a range"),
        ("count += 2 * one.direction * (passes - already)", "count += 0",
         "roots lost on the way to the embedded delay"),
        ("count, on_axis = roots_at_once(present + loop.A_e)",
         "count, on_axis = roots_at_once(present)", "roots with torque feedback"),
        ("crossings = tuple(one for one in found.crossings if one.delay <= longest)",
         "crossings = found.crossings", "crossings beyond what was asked"),
        ("end = horizon if horizon is not None else 20.0 * max(item.period for item in moving)",
         "end = 20.0 * max(item.period for item in moving)", "the horizon"),
        ("guaranteed=found.decided and found.explained and not zero_root", "guaranteed=True",
         "what is guaranteed"),
    ),
    *_of(
        "passivity", "passivity/_solve.py",
        ("upper = min(found.upper, *(float(part.upper.min()) for part in whole))",
         "upper = found.upper", "upper end of a motion"),
        ("split = (1.0 - 4.0 * len(each) * EPS) / sum(1.0 / delay for delay in each)",
         "split = min(each)", "several levels"),
        ("delay[at], upper[at] = max(delay[at], found.delay), min(upper[at], found.upper)",
         "delay[at], upper[at] = found.upper, min(upper[at], found.upper)",
         "a refuted delay is proven"),
        ("float(proven_delays(part, found.factor).min()) for",
         "float(proven_delays(part, found.factor).max()) for", "the worst instant"),
        ("delay=lessened(proven, rounding(problem))", "delay=proven", "rounding of the problem"),
        ("if delays.min() > best_delay:", "if delays.max() > best_delay:",
         "the best multiplier of a search"),
    ),
    *_of(
        "passivity", "passivity/_windows.py",
        ("bend[1:-1] = (points[2:] - 2.0 * points[1:-1] + points[:-2]) / 8.0",
         "bend[1:-1] = (points[2:] - 2.0 * points[1:-1] + points[:-2]) / 16.0",
         "motion between instants"),
        ("corner, rest, bend = (", "corner, bend, rest = (", "two parts of one sum: same",
         "their sum is the same"),
        ("radius=rest + bend", "radius=np.maximum(rest, bend)", "radius of the ball"),
        ("(tried.corner + tried.radius <= np.sqrt(2.0) * (1.0 - 4.0 * EPS)).all()",
         "(np.maximum(tried.corner, tried.radius) <= np.sqrt(2.0)).all()", "corner and ball"),
        ("low, high = along.min(axis=0), along.max(axis=0)",
         "low, high = 0.5 * along.min(axis=0), 0.5 * along.max(axis=0)",
         "boxes that are too small", "what a box leaves is added to its ball"),
    ),
    *_of(
        "passivity", "passivity/_supremum.py",
        ("power = c.question.D_theta * (real**2 + imaginary**2)",
         "power = real**2 + imaginary**2", "shares of joints"),
        ("ok=abs(upper * w - 1.0) <= AGREEMENT and upper >= c.answer.max_delay_s",
         "ok=upper >= c.answer.max_delay_s", "an upper end that is no supremum"),
        ("refuted = d * d * (real * real + imaginary * imaginary) * room >= power * power > 0",
         "refuted = True", "a worst motion that is not active"),
    ),
    *_of(
        "passivity", "passivity/_local.py",
        ("aside = float(np.abs(self.A_1[:, others]).max(initial=0.0))", "aside = 0.0",
         "a coupled law"),
        ("spring[range(n), rate] = question.spring_damping", "pass", "D_s of the frozen loop"),
        ("wanted[0, drive, drive] -= speed", "pass", "drives of the frozen loop"),
        ("friction[range(n), rate] = question.viscous_friction", "pass", "friction in the loop"),
    ),
    *_of(
        "design", "design/_criteria.py",
        ("load = np.maximum(load, abs(float(rest.tau_sea[i])))", "pass",
         "load where the loop rests"),
        ("load > limit,\n                (", "load > 10.0 * limit,\n                (",
         "motors that are too weak"),
        ("speed > limit,\n                (", "speed > 10.0 * limit,\n                (",
         "motors that are too slow"),
        ("return values[:, 0] >= -1e-9 * np.maximum", "return values[:, 0] >= -1e9 * np.maximum",
         "an indefinite task stiffness"),
        ("breaks = np.flatnonzero(np.diff(motion.contact_index)) + 1",
         "breaks = np.flatnonzero(np.diff(motion.contact_index))", "windows across a change"),
        ("if system.late_joints:", "if False:", "late torque feedback is certified"),
        ("return spaces.Lambda @ spaces.K_x", "return spaces.K_x @ spaces.Lambda",
         "the printed stiffness"),
        ("bound = bound.refused(list(missing), words + missing[first])", "pass",
         "bounds without a proof"),
    ),
    *_of(
        "design", "design/_certify.py",
        ("if not reasons and delay_s > largest:", "if not reasons and delay_s > 2.0 * largest:",
         "a delay that is too long is certified"),
        ("if case.rest is not None and not case.rest.found:", "if False:",
         "a loop without equilibrium is certified"),
        ("if case.kind is Criterion.CERTIFIED and not reasons:\n        reasons += _undercut(case)",
         "if False:\n        reasons += _undercut(case)", "a margin below the bound"),
        ("power = system.actuators.motor_damping * np.abs(case.worst_motion) ** 2",
         "power = np.abs(case.worst_motion) ** 2", "limiting joints"),
        ("return int(np.argmin(self.bound.delay))", "return 0", "the worst instant"),
        ("common=None if withdrawn else common", "common=common", "a bound that was withdrawn"),
        ("published=float(proven.delay.min()) if printed else", "published=np.inf if printed else",
         "what the paper says"),
    ),
    *_of(
        "design", "design/_local.py",
        ("worst = min(known, key=_Known.order)", "worst = known[0]", "the rest's margin"),
        ("if loop.bend > _BEND:", "if False:", "margin of a singular posture"),
        ("return int(self.unstable_roots.max())", "return int(self.unstable_roots[0])",
         "unstable instants"),
        ("return float(exact.min()) if len(exact)", "return float(exact.max()) if len(exact)",
         "smallest margin of a motion"),
        ("return bool(values[0] > _MINIMUM * values[-1])", "return True",
         "a saddle taken for a minimum"),
    ),
    *_of(
        "design", "design/_simulate.py",
        ("force = 0.05 * system.robot.weight", "force = 0.5 * system.robot.weight",
         "size of the default push"),
        ("size * w * math.sin(w * t) / 2.0 * row", "size * math.sin(w * t) / 2.0 * row",
         "speed of the tracked reference"),
        ("q[2] += system.simulation.drop_height", "pass", "height of a drop"),
        ("radius=setting.foot_radius", "radius=0.0", "radius of the feet"),
        ("if push.start_s >= length:", "if False:", "pushes that never act"),
        ("clock = replace(_clock(system), log=log_period)", "clock = _clock(system)",
         "the log's period"),
        ("w = 2.0 * math.pi * system.simulation.track_frequency_hz",
         "w = system.simulation.track_frequency_hz", "frequency of the reference"),
    ),
    *_of(
        "simulation", "simulation/_audit.py",
        ("stores[rows, :MOTOR_STORE].sum(axis=1) + 0.5 * theta_dot[rows] ** 2 @ shaped_inertia",
         "stores[rows].sum(axis=1)", "S_j with the shaped inertia"),
        ("slack[rows] = drive.sum(axis=1) + scalar[rows, DISTURBANCE] - (s_j - s_0)",
         "slack[rows] = drive.sum(axis=1) - (s_j - s_0)", "work of disturbances"),
        ("(flows[\"motor_work\"][rows] - ratio * drive).sum(axis=1)",
         "(flows[\"motor_work\"][rows] - drive).sum(axis=1)", "B / B_s of the books"),
        ("joint=None if first is None else joints[int(delivered(first).argmax())]",
         "joint=None if first is None else joints[int(delivered(first).argmin())]",
         "the joint that is named"),
        ("broken = np.flatnonzero(slack < -tolerance)", "broken = np.flatnonzero(slack < -1e9)",
         "a side that is not passive"),
        ("injection[rows] = (command[rows] - work[rows]).sum(axis=1)",
         "injection[rows] = command[rows].sum(axis=1)", "what the delay injects"),
        ("own[rows] = given + potential[rows] - potential[:1]",
         "own[rows] = given + potential[rows]", "what the law injects"),
        ("return 0.5 * (start[1] + end[1]) * (end[0] - start[0])",
         "return start[1] * (end[0] - start[0])", "the trapezoid"),
        ("lambda row: damping[row] - command[row]", "lambda row: command[row] - damping[row]",
         "the joint that is named on the joint side"),
    ),
    *_of(
        "simulation", "simulation/_network.py",
        ("central_up=delays.central.up,", "central_up=delays.central.down,", "ways swapped"),
        ("embedded_down=delays.embedded.down,", "embedded_down=delays.embedded.up,",
         "embedded ways swapped"),
        ("embedded_up=delays.embedded.up if late else None", "embedded_up=None",
         "late torque feedback that is not simulated"),
        ("embedded_period=clock.embedded", "embedded_period=0.0", "bound of a network"),
        ("passed = np.sort(self.central_down.due(tick, arrival)) if looks is None else looks",
         "passed = np.sort(tick) if looks is None else looks", "commands before they arrive"),
        ("seen=np.maximum(seen, 0.0)", "seen=tick", "measurements without delay"),
        ("known = np.minimum(link.sent(looks + 0.5 * clock.physics, rng), looks)",
         "known = looks", "late torque feedback"),
    ),
    *_of(
        "simulation", "simulation/_exchange.py",
        ("known = np.append(0.0, self.seen[self.command])",
         "known = np.append(0.0, self.tick[self.command])", "age of both together"),
        ("command=float((stop - sent)[ran].max())", "command=float((stop - sent)[ran].mean())",
         "largest age of a command"),
        ("measurement=float((self.tick - self.seen)[ticked].max())",
         "measurement=float((self.tick - self.seen)[ticked].mean())",
         "largest age of a measurement"),
    ),
    *_of(
        "simulation", "store.py",
        ("first, min(first + size, rows)", "first, min(first + size, rows - 1)",
         "the last row of a block"),
    ),
    *_of(
        "simulation", "simulation/_delay_store.py",
        ("(delay * P_now - PP_now + PP_before) / (2.0 * delay)",
         "(delay * P_now - PP_now + PP_before) / delay", "V_4"),
        ("twice += weight * part * power * part * (1.0 - node)",
         "twice += weight * part * power * part * node", "V_4 inside an interval"),
        ("coarse = np.append(np.arange(0, len(time) - 1, 2), len(time) - 1)",
         "coarse = np.arange(len(time))", "error of V_4"),
    ),
    *_of(
        "simulation", "simulation/_hold.py",
        ("worst = int(np.argmax(np.abs(hold.torque) / torque_limit))",
         "worst = int(np.argmax(np.abs(hold.torque)))", "the joint that is too weak"),
        ("if hold.use > 1.0 + 1e-6:", "if hold.use > 10.0:", "a posture that cannot be held"),
        ("torque = g[base:] - G[:, base:].T @ best[:-1]", "torque = g[base:]",
         "torques of contact forces"),
        ("q[2] -= gap.min()", "q[2] -= gap.max()", "which foot touches first"),
    ),
    *_of(
        "walking", "walking/_planner.py",
        ("lift = clearance + self._obstacle(begin, end)", "lift = clearance", "obstacles"),
        ("bump_rate = 192.0 * (u * (1.0 - u)) ** 2 * (1.0 - 2.0 * u) * rate",
         "bump_rate = 96.0 * (u * (1.0 - u)) ** 2 * (1.0 - 2.0 * u) * rate",
         "speed of the swing foot"),
        ("blend_rate = 30.0 * u * u * (1.0 - u) ** 2 * rate",
         "blend_rate = 30.0 * u * u * (1.0 - u) ** 2", "forward speed of the swing foot"),
        ("vz = last.slope * speed[0]", "vz = 0.0", "vertical speed of the last stance"),
        ("slope=float((feet[k + 2][2] - feet[k][2]) / (feet[k + 2][0] - feet[k][0]))",
         "slope=float((feet[k + 1][2] - feet[k][2]) / (feet[k + 1][0] - feet[k][0]))",
         "slope of a plane"),
        ("after.append(math.asinh(omega[k] * (at - x[k]) / v[k]) / omega[k])",
         "after.append(math.asinh(omega[k] * (at - x[k]) / v[k + 1]) / omega[k])",
         "time after an apex"),
        ("y.append(place + speed / w1 / math.tanh(w1 * before[k]))",
         "y.append(place + speed / w0 / math.tanh(w0 * before[k]))", "lateral foothold"),
        ("side = width if len(x) % 2 else -width", "side = width", "the last foothold's side"),
    ),
    *_of(
        "robot", "robot/_load.py",
        ("limit.set(\"upper\", \"1e9\")", "limit.set(\"upper\", \"3.2\")", "continuous joints"),
        ("at[model.joints[number].idx_q] = followers[name].offset", "pass",
         "followers that are locked"),
        ("weak = (own < LEAST_INERTIA) |", "weak = (own < 0.0) |", "links without inertia"),
    ),
    *_of(
        "robot", "robot/_workspace.py",
        ("return self._weight * self.terms.com_jacobian[2]",
         "return self._weight * self.terms.com_jacobian[1]", "direction of gravity"),
        ("return float(self.terms.energy[self._kernel.KINETIC])",
         "return float(self.terms.energy[self._kernel.POTENTIAL])", "kinetic energy"),
    ),
    *_of(
        "files", "files.py",
        ("fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)", "pass", "two writers of one file"),
        ("os.fchmod(self.file.fileno(), stat.S_IMODE(self.path.stat().st_mode))", "pass",
         "mode of a file"),
        ("self.path = _target(path)", "self.path = Path(path)", "links"),
        ("if status.st_nlink == 1:", "if True:", "a whole file with the draft's name too"),
        ("os.ftruncate(handle, 0)", "pass", "what a killed writer left"),
        ("| os.O_NOFOLLOW", "", "a link with the draft's name"),
    ),
    *_of(
        "files", "report/_mcap.py",
        ("if self.whole and kind is None and failure is None:", "if failure is None:",
         "a cut-off recording replaces a whole one"),
        ("if kind is KeyboardInterrupt:", "if False:",
         "Ctrl-C while recording"),
        ("nanoseconds = round(stamp * 1e9)", "nanoseconds = int(stamp * 1e9)",
         "times of messages, by a nanosecond"),
    ),
    *_of(
        "cli", "cli/_terminal.py",
        ("repr(one)[1:-1] if unicodedata.category(one) in _HIDDEN else one", "one",
         "names that are orders"),
        ("if getattr(sys, name) is None:", "if False:", "closed streams"),
        ("stream.reconfigure(errors=\"backslashreplace\")", "pass", "letters that ASCII lacks"),
    ),
    *_of(
        "cli", "cli/_app.py",
        ("return FAILED if isinstance(error, SolverError) else WRONG", "return WRONG",
         "status of a search that stopped"),
        ("if not answered and status in (0, 1):", "if False:", "an answer that nobody reads"),
    ),
    *_of(
        "cli", "cli/_commands.py",
        ("return 0 if certificate.answer.status is Status.CERTIFIED else 1", "return 0",
         "status of a no"),
        ("key=lambda item: -item[1])\n    limiting", "key=lambda item: item[1])\n    limiting",
         "order of the limiting joints"),
        ("return 0 if result.valid else 1", "return 0", "status of a forged certificate"),
    ),
    *_of(
        "units", "units.py",
        ("if value_s > LONGEST_DELAY_S:", "if value_s > 1e3 * LONGEST_DELAY_S:",
         "milliseconds taken for seconds"),
        ("return value_ms * 1e-3", "return value_ms * 1e-6", "milliseconds"),
    ),
]  # fmt: skip
