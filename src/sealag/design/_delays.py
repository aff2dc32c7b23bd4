"""[delays] of the project file: both connections, way by way."""

from pathlib import Path
from typing import Any

import numpy as np

from sealag.delay import (
    Constant,
    Delays,
    Link,
    PacketOrder,
    RoundTrip,
    Sinusoid,
    Table,
)
from sealag.design._plain_words import named
from sealag.errors import ProjectError
from sealag.files import read_whole
from sealag.units import number_of

LARGEST_SAMPLES_BYTES = 50_000_000


def delays_of(section: Any, folder: Path, path: Path) -> Delays:
    """Return the delays of both connections.

    Args:
        section: the keys.
        folder: where relative paths start.
        path: the project file.

    Raises:
        ProjectError: a connection is missing or there twice, or a delay is none.
        FileError: samples cannot be read.
    """
    return Delays(
        central=_connection(section, "central", folder, path),
        embedded=_connection(section, "embedded", folder, path),
        sample_time=section.sample_time_ms * 1e-3,
        embedded_period=section.embedded_period_ms * 1e-3,
        delayed_torque_feedback=section.delayed_torque_feedback,
    )


def _connection(section: Any, name: str, folder: Path, path: Path) -> RoundTrip:
    """A connection from its round trip, or from both of its ways."""
    sections = {way: getattr(section, f"{name}_{way}") for way in ("round_trip", "up", "down")}
    given = {way for way, keys in sections.items() if keys is not None}
    if given not in ({"round_trip"}, {"up", "down"}):
        said = "given besides one of its ways" if "round_trip" in given else "missing"
        raise ProjectError(
            f"{path}: the key delays.{name}_round_trip is {said}; give it alone, or both {name}_up "
            f"and {name}_down."
        )
    links = {}
    for way in given:
        with named(path, f"delays.{name}_{way}"):
            links[way] = Link(delay=_signal(sections[way], folder), **_packets(sections[way]))
    if "round_trip" not in links:
        return RoundTrip(**links)
    whole = sections["round_trip"]
    return RoundTrip.halved(links["round_trip"].delay, **_packets(whole))


def _packets(keys: Any) -> dict[str, Any]:
    return {
        "jitter": keys.jitter_ms * 1e-3,
        "loss": keys.packet_loss,
        "max_burst": keys.max_burst,
        "order": PacketOrder(keys.order),
    }


def _signal(section: Any, folder: Path) -> Constant | Sinusoid | Table:
    match section.kind:
        case "constant":
            return Constant(section.value_ms * 1e-3)
        case "sinusoid":
            return Sinusoid(
                mean=section.mean_ms * 1e-3,
                amplitude=section.amplitude_ms * 1e-3,
                angular_frequency=section.angular_frequency_rad_s,
                phase=section.phase_rad,
            )
        case "table":
            return Table(time=np.asarray(section.time_s), delay=np.asarray(section.delay_ms) * 1e-3)
        case _:
            return _samples(section, folder)


def _samples(section: Any, folder: Path) -> Table:
    """Measured delays: one number (ms) a line."""
    path = folder / section.file
    content = read_whole(path, what="The delay samples", largest=LARGEST_SAMPLES_BYTES)
    values = []
    for row, line in enumerate(content.decode("utf-8-sig", "replace").splitlines(), start=1):
        value = number_of(line)
        if value is None and line.strip():
            raise ProjectError(f"{path}: line {row} is no number; one delay in ms a line is right.")
        values += [] if value is None else [value]
    if not values:
        raise ProjectError(f"{path} is empty; one delay in ms a line is needed.")
    return Table.measured(
        np.array(values) * 1e-3, period=section.period_s, quantile=section.quantile
    )
