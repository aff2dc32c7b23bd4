"""What damping costs: torque bandwidth and phase lag of a drive over D_θ, with the link locked."""

from sealag.actuation import Actuators
from sealag.delay import Constant, Delays

delays = Delays(central=Constant(0.020), embedded=Constant(0.003))
damping = (2.0, 5.0, 10.0, 20.0, 50.0)
drives = Actuators.of(
    [f"D_theta = {value:g} Nms/rad" for value in damping],
    spring_stiffness=350.0,
    rotor_inertia=0.09,
    motor_damping=damping,
)
answer = drives.transparency(delay=delays.d_2)
for name, bandwidth, ratio, lag in zip(
    drives.joints, answer.bandwidth, answer.damping_ratio, answer.phase_lag, strict=True
):
    print(f"{name:24} {bandwidth:6.2f} Hz, damping ratio {ratio:.2f}, lag at 1 Hz {lag:.3f} rad")
