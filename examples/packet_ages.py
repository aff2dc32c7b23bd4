"""How old packets get under jitter and loss, without a robot: what ages the bound d_1 covers."""

from sealag.delay import Constant, Delays, Link, RoundTrip
from sealag.simulation import Clock, Network

lossy = Link(delay=Constant(0.004), jitter=0.002, loss=0.05, max_burst=3)
delays = Delays(
    central=RoundTrip(up=lossy, down=lossy),
    embedded=Constant(0.001),
    sample_time=1e-3,
)
network, clock = Network.from_delays(delays), Clock(physics=1e-3, central=1e-3)
for seed in range(3):
    ages = network.plan(clock, duration=60.0, seed=seed).ages(60.0)
    print(
        f"seed {seed}: measurement {ages.measurement * 1e3:.2f} ms, command "
        f"{ages.command * 1e3:.2f} ms, together {ages.total * 1e3:.2f} ms"
    )
print(f"the certificate counts {network.delay_bound(clock) * 1e3:.2f} ms")
