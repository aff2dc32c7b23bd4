"""The text of a starter project: what must be filled in, and what may be given besides."""

REQUIRED = """\
# sealag project for {name}: what `sealag certify` needs to know besides the URDF.
# Values that begin with FILL are not known from the URDF; replace each by a number.
# SI units throughout; delays are in ms, as their keys say. Keys behind a # may be given;
# they show their defaults unless the comment says what holds if they are left out.

[robot]
urdf = {urdf}
base = "{base}"          # "floating" or "fixed": {why}
actuated = [             # joints with an actuator; their mimics follow, the others are locked
{actuated}
]

[posture]                # certified when no motion is given (--motion)
{posture}

[actuators.default]      # where the joint slides: N and m for Nm and rad, kg for kg m^2
spring_stiffness = "FILL: K, Nm/rad (N/m where the joint slides)"
rotor_inertia = {rotor}
inertia_shaping = "FILL: beta = B_s / B; 1 without torque feedback"
motor_damping = "FILL: D_theta, Nms/rad (Ns/m where the joint slides), embedded and not delayed"
# spring_damping = 0.0         # Nms/rad
# coulomb_friction = 0.0       # Nm, of the motor; the URDF's friction if left out
# viscous_friction = 0.0       # Nms/rad, of the motor
# torque_limit = 80.0          # Nm; the URDF's effort if left out
# velocity_limit = 12.0        # rad/s; the URDF's velocity if left out
# torque_bandwidth = 600.0     # rad/s, of the current loop; ideal if left out
{differing}
{contacts}
[controller]
# kind = "wbosc"               # the law of the tasks below; or joint_pd, which has no tasks but
# kp (Nm/rad) and kd (Nms/rad), a number for all joints or a table with one of each, gravity,
# feedback (motor or joint) and damping_at ("controller", where kd is late, or "drive"); or python,
# with the file of a function (function) that makes what ticks from a System, and nothing else; or
# matrices: A, B, C, D (lists of rows, or a file of them, NPZ) of motors or joints (feedback), of
# positions about the posture, then rates (inputs, outputs: names of joints, all if left out), and
# time ("continuous", or "discrete" of sample_time_ms).
feedback = "motor"             # motor | static_joint | static_joint_tank | joint
gravity = "planned"            # feedback | planned | none
stiffness_form = "symmetric"   # symmetric | published | force (without the task inertia)
criterion = "certified"        # certified | published
# task_inertia = "lambda_ts"   # lambda_ts, Eq. (10) | lambda_star, of what the motors move
# task_error = "consistent"    # consistent (what higher tasks leave) | plain (as printed)
# tank_flow = "corrected"      # corrected | published; the tank is that of static_joint_tank
# tank_energy_j = 1.0          # at the start
# tank_rate = 5.0              # 1/s, at which the fed-back x follows while the tank can pay

[[tasks]]
name = "posture"
kind = "posture"               # com | position | orientation | pose | posture
stiffness = "FILL: 1/s^2, times the task inertia; N/m or Nm/rad if stiffness_form is force"
priority = 1
# damping = 0.0                # N s/m or Nm s/rad, that the controller computes, late like the rest

# Delays are constant, sinusoid (mean_ms, amplitude_ms, angular_frequency_rad_s), table (time_s,
# delay_ms) or samples (file of measured ones in ms, period_s), each with jitter_ms, packet_loss,
# max_burst and order ("fifo", "newest", "arrival") if packets are late or lost; these hold for each
# way of a round trip, so that a jitter counts on the way up and on the way down. Instead of a round
# trip both of its ways may be given: central_up and central_down, embedded_up and embedded_down.
[delays]
central_round_trip = {{ kind = "constant", value_ms = "FILL: T_H, ms" }}
embedded_round_trip = {{ kind = "constant", value_ms = "FILL: T_L, ms" }}
sample_time_ms = 1.0           # period of the central controller; its hold is added
# embedded_period_ms = 0.0     # at which the robot's side sends and looks; added for each link
"""

OPTIONAL = """\

# A motion to certify at every instant instead of the posture (CSV, NPZ or Parquet):
# [motion]
# file = "motion.csv"

# How `sealag simulate` runs the design:
{simulation}
# scenario = "regulate"        # regulate | track | drop | balance | walk
# duration_s = 2.0
# physics_step_ms = 0.5        # as fine as the fastest spring needs, at most 1, if left out
# log_period_ms = 20.0         # between two logged instants; the controller's period if left out
# model_period_ms = 0.0        # at which J* and the task inertia are updated; 0: at every tick
# friction = 0.8               # of the ground
# foot_radius = 0.0            # m
{soles}
# torsional_damping = 0.0      # Nms/rad, of a foot that turns on the ground
# torsional_radius = 0.02      # m, of the pressure that such a foot can use; none if left out
# drop_height = 0.03           # m, for drop
# track_amplitude = 0.02       # m or rad, for track: the first row of the first task
# track_frequency_hz = 0.5
# seed = 0                     # of jitter and losses
# [[simulation.pushes]]        # as many as you like
# frame = {frame}
# force_n = [20.0, 0.0, 0.0]   # in the world's axes
# start_s = 0.2
# duration_s = 0.1

# A biped's walk, for the scenario walk:
# [walking]
# feet = [{feet}]
# steps = 7
# friction = 0.8
# terrain = {{ kind = "paper" }} # or flat, rough (seed, amplitude_m), stairs (rises_m, run_m)
# [walking.gait]
# apex_speed = 0.5             # m/s over the stance foot; the other keys are in bundled:hume
"""

SOLES = """\
# foot_half_length = 0.1       # m, of surfaces
# foot_half_width = 0.06       # m, of surfaces"""

DIFFERING = """\
# Joints that differ:
# [actuators.joint.{joint}]
# spring_stiffness = 350.0"""
