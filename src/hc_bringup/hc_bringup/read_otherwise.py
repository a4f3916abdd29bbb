"""A recording whose channels are turned, scaled, zeroed and stamped as input settings say."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from hc_msgs_py.units import NANOSECONDS

if TYPE_CHECKING:
    from hc_estimator.stream.tare import TareResult

LEAST_TOGETHER = 0.5
"""Share of a recording in which an offset has to leave both channels."""
_FIRST = 20_000
"""Samples that the slow comparison of the channels gets."""


def less_zeros(recording: Any, zeros: Mapping[str, float]) -> Any:
    """Return a recording with zeros [mm, N] taken off."""
    return dataclasses.replace(
        recording,
        displacement_mm=recording.displacement_mm - zeros.get("position.zero", 0.0),
        force_n=recording.force_n - zeros.get("force.zero", 0.0),
    )


def read_as(recording: Any, settings: Mapping[str, Any]) -> Any:
    """Return a table with its channels turned, scaled, zeroed and stamped as the settings say."""
    import numpy as np

    from hc_estimator.stream.arrival_clock import ARRIVAL, measured_stamps

    def factor(channel: str) -> float:
        return float(settings.get(f"{channel}.sign", 1) * settings.get(f"{channel}.scale", 1.0))

    read = less_zeros(
        dataclasses.replace(
            recording,
            displacement_mm=recording.displacement_mm * factor("position"),
            force_n=recording.force_n * factor("force"),
        ),
        settings,
    )
    read = each_once(read, settings)
    stamps = []
    for channel, column in (("position", "displacement_mm"), ("force", "force_n")):
        there = np.isfinite(getattr(read, column))
        offset_ns = round(settings.get(f"{channel}.time_offset", 0.0) * NANOSECONDS)
        own = read.stamps + offset_ns
        if settings.get(f"{channel}.stamps") == ARRIVAL:
            own[there] = measured_stamps(own[there])
        stamps.append(own)
    return at_own_stamps(read, *stamps)


def at_own_stamps(recording: Any, of_displacement: Any, of_force: Any) -> Any:
    """Return a recording with every reading at a stamp of its own, as the node has them.

    Args:
        recording: hc_logger.recorded.Recording.
        of_displacement: stamps of the displacements [ns], shape (n,).
        of_force: stamps of the forces [ns], shape (n,).
    """
    import numpy as np

    if np.array_equal(of_displacement, of_force):
        if np.array_equal(of_displacement, recording.stamps):
            return recording
        moved_s = (of_force - recording.stamps) * 1e-9
        return _counted_anew(
            dataclasses.replace(recording, time_s=recording.time_s + moved_s, stamps=of_force)
        )
    channels = (recording.displacement_mm, recording.force_n)
    there = [np.flatnonzero(~np.isnan(values)) for values in channels]
    own = [stamps[rows] for stamps, rows in zip((of_displacement, of_force), there, strict=True)]
    stamps = np.concatenate(own)
    times = np.concatenate(
        [
            recording.time_s[rows] + (moved - recording.stamps[rows]) * 1e-9
            for rows, moved in zip(there, own, strict=True)
        ]
    )
    readings = np.full((len(stamps), 2), np.nan)
    readings[: len(there[0]), 0] = channels[0][there[0]]
    readings[len(there[0]) :, 1] = channels[1][there[1]]
    order = np.argsort(stamps, kind="stable")
    return _counted_anew(
        dataclasses.replace(
            recording,
            time_s=times[order],
            stamps=stamps[order],
            sequence=np.arange(len(order), dtype=np.uint64),
            displacement_mm=np.ascontiguousarray(readings[order, 0]),
            force_n=np.ascontiguousarray(readings[order, 1]),
        )
    )


def _counted_anew(recording: Any) -> Any:
    """Return a recording whose findings are of the stamps that it has now."""
    import numpy as np

    from hc_logger.findings import findings_of

    rows = np.column_stack([recording.displacement_mm, recording.force_n])
    found = findings_of(rows, np.diff(recording.stamps), ())
    names = ("repeated", "backward", "set_back")
    of_stamps = {name: getattr(found, name) for name in names}
    return dataclasses.replace(recording, findings=recording.findings._replace(**of_stamps))


def check_as_read(sensors: Mapping[str, Any]) -> None:
    """Check the values that topics of sensors would have checked.

    Raises:
        ValueError: if one is not allowed.
    """
    from hc_logger.sensors import LONGEST_S

    for name, value in sensors.items():
        if name.endswith(".sign") and value not in (1, -1):
            raise ValueError(f"{name}={value} is not 1 or -1")
        if name.endswith(".time_offset") and abs(value) > LONGEST_S:
            raise ValueError(f"{name}={value:g} s is not a number up to {LONGEST_S:g}")


def check_overlap(recording: Any, read: Any, settings: Mapping[str, Any]) -> None:
    """See that offsets of stamps leave the channels at one time.

    Args:
        recording: as it stands.
        read: the same with its stamps shifted.
        settings: the offsets among them.

    Raises:
        ValueError: if they are together for less than half as long as they were.
    """
    offsets = [f"{name}={s:g}" for name, s in settings.items() if name.endswith(".time_offset")]
    if not offsets:
        return
    before_s, after_s = _together_s(recording), _together_s(read)
    if after_s < LEAST_TOGETHER * before_s:
        raise ValueError(
            f"{', '.join(offsets)} s leaves {after_s:.3g} of the {before_s:.3g} s in which there "
            "are displacements and forces: it is what is added to the stamps of a sensor that is "
            "late or early, -0.02 say"
        )


def _together_s(recording: Any) -> float:
    """Return for how long both channels have readings [s]."""
    import numpy as np

    spans = []
    for values in (recording.displacement_mm, recording.force_n):
        stamps = recording.stamps[~np.isnan(values)]
        if not stamps.size:
            return 0.0
        spans.append((int(stamps.min()), int(stamps.max())))
    (first, last), (begin, end) = spans
    return max(0, min(last, end) - max(first, begin)) / NANOSECONDS


def what_is_allowed(name: str, value: float | str) -> str:
    """Return what an input setting may be if this cannot be one, else nothing."""
    from hc_estimator.ros.node_settings import NODE_SETTINGS

    checked = ("frame_compliance", "dry_friction", "presliding", "moving_mass", "damping")
    if name.rpartition(".")[2] not in ("scale", "stamps", *checked):
        return ""
    setting = NODE_SETTINGS[f"input.{name}"]
    return "" if setting.accepted(value) is not None else setting.allowed


def each_once(recording: Any, settings: Mapping[str, Any]) -> Any:
    """Return a table without the readings that a channel only repeats, where one is said to."""
    import numpy as np

    from hc_estimator.stream.repeats import once_each

    changed = {}
    for channel, column in (("position", "displacement_mm"), ("force", "force_n")):
        if settings.get(f"{channel}.held", False):
            changed[column] = once_each(recording.stamps, getattr(recording, column))
    if not changed:
        return recording
    names = (column.partition("_")[0] for column in changed)
    once = tuple(dict.fromkeys((*recording.findings.counted_once, *names)))
    findings = recording.findings._replace(counted_once=once)
    read = dataclasses.replace(recording, findings=findings, **changed)
    lost = [np.isnan(new) & ~np.isnan(getattr(recording, name)) for name, new in changed.items()]
    return less_empty(read, np.any(lost, axis=0))


def less_empty(recording: Any, lost: Any) -> Any:
    """Return a recording without the rows that hold no reading any more.

    Args:
        recording: hc_logger.recorded.Recording.
        lost: which rows had one more, shape (n,).
    """
    import numpy as np

    rows = ~(lost & np.isnan(recording.displacement_mm) & np.isnan(recording.force_n))
    if rows.all():
        return recording
    columns = ("time_s", "stamps", "sequence", "displacement_mm", "force_n")
    return dataclasses.replace(
        recording, **{name: getattr(recording, name)[rows] for name in columns}
    )


def surface_note(found: Any, surface_mm: float) -> str:
    """Say where the surface was found, in as many digits as position.zero needs.

    Half a metre from the robot's base four digits were less than the deviation.

    Args:
        found: what find_surface() of hc_estimator.stream.surface returned.
        surface_mm: its position.
    """
    deviation_mm = found.displacement_std_mm
    decimals = min(9, max(0, 2 - math.floor(math.log10(deviation_mm)))) if deviation_mm > 0.0 else 9
    return (
        f"surface found at {surface_mm:.{decimals}f} mm (± {deviation_mm:.2g}), "
        f"force zero {found.force_n:.6g} N: taken off"
    )


def from_surface(recording: Any, mm_per_n: float) -> Any:
    """Return a recording with the zeros of its first approach taken off.

    Args:
        recording: less what the robot gave way.
        mm_per_n: the frame's compliance, under forces that count from no zero.

    Raises:
        UserError: if there is no approach in it.
    """
    from hc_bringup.errors import UserError
    from hc_estimator.stream.readings import Check
    from hc_estimator.stream.sanity import check_samples
    from hc_estimator.stream.surface import find_surface, why_no_surface
    from hc_estimator.stream.together import together

    paired = together(recording.time_s, recording.displacement_mm, recording.force_n)
    pairs = paired[1:]
    found = find_surface(*pairs)
    if found is None:
        # A force that only falls below its zero has no approach: mostly its sign is turned.
        turned = [s.sentence for s in check_samples(*paired) if s.check is Check.SIGN]
        why = turned[0] if turned else why_no_surface(*pairs)
        raise UserError(f"--find-surface: {recording.path}{':'[: len(turned)]} {why}")
    found, late = _with_delay(recording, found)
    # As input.position.zero: with the force zero taken off, less is taken off for the compliance.
    surface_mm = found.displacement_mm + mm_per_n * found.force_n
    note = surface_note(found, surface_mm) + late
    zeroed = less_zeros(
        recording, {"position.zero": found.displacement_mm, "force.zero": found.force_n}
    )
    findings = recording.findings
    return dataclasses.replace(
        zeroed,
        findings=findings._replace(notes=(*findings.notes, note)),
        contact_position_std_mm=found.displacement_std_mm,
        found_zeros={"position.zero": surface_mm, "force.zero": found.force_n},
    )


def _with_delay(recording: Any, found: TareResult) -> tuple[TareResult, str]:
    """Return the surface with a delay between the channels allowed for, and words on that.

    Of a position that is 30 ms late an approach of 25 mm/s sees the surface 0.7 mm too deep, and
    nothing in that approach shows it.

    Args:
        recording: as it was read.
        found: its surface, as of channels in step.
    """
    from hc_bringup.channel_findings import CLEAR_DELAY_S
    from hc_bringup.place_delay import Delay
    from hc_estimator.stream.surface import find_surface
    from hc_estimator.stream.together import together
    from hc_evaluation.channels import CLEAR, diagnose_channels, evenly_spaced, unbroken

    depth_mm = recording.displacement_mm - found.displacement_mm
    force_n = recording.force_n - found.force_n
    try:
        even = evenly_spaced(*unbroken(recording.time_s, depth_mm, force_n))
        channels = diagnose_channels(*(column[:_FIRST] for column in even))
    except ValueError:
        return found, ""  # too little to compare
    known = abs(channels.delay_s) > max(CLEAR_DELAY_S, CLEAR * channels.delay_std_s)
    if "delay" not in channels.clear_faults or not known:
        return found, ""
    shifted = read_as(recording, {"force.time_offset": -channels.delay_s})
    pairs = together(shifted.time_s, shifted.displacement_mm, shifted.force_n)[1:]
    again = find_surface(*pairs)
    if again is None:
        return found, ""
    delay = Delay(channels.delay_s, channels.delay_std_s, 1)
    late = "force" if delay.seconds > 0.0 else "position"
    return again, (
        f"; {delay.late}: the surface allows for that, the estimates with "
        f"--input {late}.time_offset={-abs(delay.seconds):.4f}"
    )


def settings_that_repeat(given: Mapping[str, Any], recording: Any) -> dict[str, Any]:
    """Return the settings that read a recording as it stands, without looking for its surface.

    What is found wrong afterwards counts from there.

    Args:
        given: settings by name below `input.`.
        recording: as they and a search for its surface made it.
    """
    from hc_bringup.terminal.numbers import rounded
    from hc_estimator.stream.vocabulary import CONTACT_POSITION_STD

    settings = dict(given)
    for name, value in recording.found_zeros.items():
        settings[name] = rounded(settings.get(name, 0.0) + value, 4)
    if recording.found_zeros:
        settings[CONTACT_POSITION_STD] = float(f"{recording.contact_position_std_mm:.2g}")
    return settings
