"""Settings that a force and a position sensor of one's own have alike: how each is read."""

from __future__ import annotations

from hc_estimator.stream.arrival_clock import ARRIVAL, MEASURED
from hc_estimator.stream.mapping import AXES
from hc_msgs_py.specification import ParameterSpecification, setting


def sensor_settings(
    sensor: str, topic: str, zero: str, unit: str, message: str
) -> tuple[ParameterSpecification, ...]:
    """Return what both sensors have: topic, axis, sign, scale, zero and what stamps say."""
    name = f"input.{sensor}"
    return (
        setting(f"{name}.topic", topic, f"Topic of the {sensor} sensor, {message}."),
        setting(
            f"{name}.axis",
            "z",
            f"Component of the sensor's vector that is the {sensor}; direction: see there.",
            choices=AXES,
        ),
        setting(
            f"{name}.direction",
            [0.0, 0.0, 1.0],
            "Direction in the sensor's frame, of any length, for axis direction.",
        ),
        setting(
            f"{name}.sign",
            1,
            "1 or -1: penetration and compression are to be positive.",
            minimum=-1,
            maximum=1,
        ),
        setting(
            f"{name}.scale",
            1.0,
            "Factor of the reading, for a sensor that does not speak SI (m per rad of a joint).",
            minimum=1e-9,
            maximum=1e9,
        ),
        setting(f"{name}.zero", 0.0, f"{zero}.", minimum=-1e6, maximum=1e6, unit=unit),
        setting(
            f"{name}.time_offset",
            0.0,
            "Added to the stamps, to make up for a delay of this sensor.",
            minimum=-10.0,
            maximum=10.0,
            unit="s",
        ),
        setting(
            f"{name}.held",
            False,
            "The topic repeats the last reading until there is a new one: count each once.",
        ),
        setting(
            f"{name}.stamps",
            MEASURED,
            "measured: stamps say when a reading was measured; arrival: when it arrived, of a "
            "sensor that reads at an even rate (in packets, over USB or a network).",
            choices=(MEASURED, ARRIVAL),
        ),
    )
