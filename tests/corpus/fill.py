"""What stands for the FILLs of a starter file: plausible numbers, by key."""

import re

VALUES = {
    "spring_stiffness": 300.0,
    "rotor_inertia": 0.1,
    "inertia_shaping": 0.3,
    "motor_damping": 20.0,
    "stiffness": 100.0,
    "central_round_trip": 2.0,
    "embedded_round_trip": 1.0,
}
BENT = {"knee": 0.8, "kfe": 0.8, "calf": -1.4, "hfe": -0.4, "thigh": 0.7, "hip_pitch": -0.4}
"""Positions of joints by a word in their names, rad: legs that are bent. Other joints are at 0."""

_FILL = re.compile(r'^(?P<key>[^#=\n]+?) = (?P<before>.*?)"FILL[^"]*"', re.MULTILINE)


def filled(text: str, *, limits: dict[str, tuple[float, float]]) -> str:
    """Replace every FILL by a number.

    Args:
        text: a starter file.
        limits: lower and upper position limit of every joint; a posture stays inside.

    Raises:
        KeyError: a key that is neither known here nor a joint is to be filled in.
    """

    def number(found: re.Match[str]) -> str:
        key = found["key"].strip()
        value = VALUES.get(key)
        if value is None:
            name = key.strip('"')
            bent = next((at for word, at in BENT.items() if word in name.lower()), 0.0)
            low, high = limits[name]
            side = bent if low <= bent <= high else -bent
            value = min(max(side, low), high)
        return f"{key} = {found['before']}{value!r}"

    return _FILL.sub(number, text)
