"""A recording less what a robot does to its readings: it gives way, is held back, has a mass."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

FARTHEST = 1.2
"""Times what the tool moved: a robot gives way no further, and readings have noise."""


COMPLIANCE = "position.frame_compliance"
FRICTION = ("force.dry_friction", "force.presliding")
MOTION = ("force.moving_mass", "force.damping")
MECHANICS = (COMPLIANCE, *FRICTION, *MOTION)
"""Settings of what lies between tissue and sensors, by their names below `input.`."""
MOVES_WITH = (FRICTION[0], *MOTION)
"""Those that take off what the motion at a force's own time makes of it."""


def less_mechanics(recording: Any, settings: Mapping[str, Any], *, of_samples: bool) -> Any:
    """Return a recording less what is said of a robot.

    Args:
        recording: hc_logger.recorded.Recording.
        settings: of `MECHANICS`, as far as they are given.
        of_samples: whether its samples were read, which may be less it already.

    Raises:
        ValueError: if that is more than can be.
    """
    read = less_compliance(recording, settings.get(COMPLIANCE, 0.0), of_samples=of_samples)
    motion, friction = (
        {name: settings[name] for name in names if name in settings} for names in (MOTION, FRICTION)
    )
    read = less_motion(read, motion, of_samples=of_samples)
    return less_friction(read, friction, of_samples=of_samples)


def less_compliance(recording: Any, mm_per_n: float, *, of_samples: bool) -> Any:
    """Return a recording without what the robot gave way under the force of the moment.

    Args:
        recording: hc_logger.recorded.Recording.
        mm_per_n: the frame's compliance.
        of_samples: whether its samples were read, which may be less it already.

    Raises:
        ValueError: if the robot would have given way further than the tool moved.
    """
    import numpy as np

    from hc_estimator.stream.frame_compliance import SETTING, FrameCompliance

    if not mm_per_n:
        return recording
    yielded_mm = FrameCompliance(mm_per_n).of_many(recording.stamps, recording.force_n)
    displacement_mm = recording.displacement_mm - yielded_mm
    most_mm, moved_mm = (_range(values) for values in (yielded_mm, recording.displacement_mm))
    if most_mm > FARTHEST * moved_mm:
        raise ValueError(
            f"position.frame_compliance={mm_per_n:g} takes off {most_mm:.3g} mm, and the tool "
            f"moves by {moved_mm:.3g} mm only: is it in mm/N, and are signs and units right?"
        )
    notes = [f"frame compliance {mm_per_n:g} mm/N: up to {most_mm:.3g} mm taken off"]
    lost = np.isnan(displacement_mm) & ~np.isnan(recording.displacement_mm)
    if of_samples and (already := recording.taken_off_already(SETTING.name)):
        notes.append(
            f"its samples are recorded less {already:g} mm/N already: {already + mm_per_n:g} in all"
        )
    unknown = int(np.count_nonzero(lost))
    if unknown:
        notes.append(
            f"{unknown} displacement{'s'[: unknown > 1]} left out: no force near them says how far "
            "the robot gave way"
        )
    findings = recording.findings
    return dataclasses.replace(
        recording,
        displacement_mm=displacement_mm,
        findings=findings._replace(notes=(*findings.notes, *notes)),
    )


def less_friction(recording: Any, settings: Mapping[str, Any], *, of_samples: bool) -> Any:
    """Return a recording without what friction between force sensor and tissue does to the force.

    Args:
        recording: hc_logger.recorded.Recording.
        settings: force.dry_friction [N] and force.presliding [mm]; what is missing is the node's
            default.
        of_samples: whether its samples were read, which may be less it already.

    Raises:
        ValueError: if there is a presliding and no friction, or a friction beyond all forces.
    """
    import numpy as np

    from hc_bringup.read_otherwise import less_empty
    from hc_estimator.stream.dry_friction import DRY_FRICTION, DryFriction

    friction = DryFriction()
    friction.configure({f"input.{name}": value for name, value in settings.items()})
    if not friction.newtons:
        if settings.get("force.presliding") is not None:
            raise ValueError("force.presliding is of force.dry_friction, which is not given")
        return recording
    if friction.newtons > (range_n := _range(recording.force_n)):
        raise ValueError(
            f"force.dry_friction={friction.newtons:g} N is more than the {range_n:.3g} N by which "
            "the force changes: is it in N, and are signs and units right?"
        )
    force_n = recording.force_n - friction.of_many(recording.stamps, recording.displacement_mm)
    lost = np.isnan(force_n) & ~np.isnan(recording.force_n)
    share = np.count_nonzero(lost) / max(1, int(np.count_nonzero(~np.isnan(recording.force_n))))
    notes = [
        f"dry friction of {friction.newtons:g} N taken off; {100.0 * share:.0f} % of the forces "
        "left out while it turned"
    ]
    if of_samples and (already := recording.taken_off_already(DRY_FRICTION.name)):
        total = already + friction.newtons
        notes.append(f"its samples are recorded less {already:g} N already: {total:g} N in all")
    findings = recording.findings
    once = tuple(dict.fromkeys((*findings.counted_once, "force")))
    findings = findings._replace(notes=(*findings.notes, *notes), counted_once=once)
    read = dataclasses.replace(recording, force_n=force_n, findings=findings)
    return less_empty(read, lost)


def less_motion(recording: Any, settings: Mapping[str, Any], *, of_samples: bool) -> Any:
    """Return a recording without what moving the tool takes of the force.

    Args:
        recording: hc_logger.recorded.Recording.
        settings: force.moving_mass [kg] and force.damping [N s/mm], as far as they are given.
        of_samples: whether its samples were read, which may be less it already.

    Raises:
        ValueError: if that is more than all forces.
    """
    import numpy as np

    from hc_bringup.read_otherwise import less_empty
    from hc_estimator.stream.tool_motion import SETTINGS, ToolMotion

    motion = ToolMotion()
    motion.configure({f"input.{name}": value for name, value in settings.items()})
    if not (motion.mass_kg or motion.damping):
        return recording
    readings = (recording.stamps, recording.displacement_mm, recording.force_n)
    force_n = motion.of_many(*readings)
    lost = np.isnan(force_n) & ~np.isnan(recording.force_n)
    range_n, taken_n = _range(recording.force_n), _range(recording.force_n - force_n)
    values = {one: settings.get(one.name.removeprefix("input."), 0.0) for one in SETTINGS}
    more = {one: value for one, value in values.items() if value}
    given = " and ".join(f"{value:g} {one.unit}" for one, value in more.items())
    if taken_n > FARTHEST * range_n:
        raise ValueError(
            f"{given} of the moving tool takes {taken_n:.3g} N, and the force changes by "
            f"{range_n:.3g} N only: are signs and units right?"
        )
    notes = [
        f"what moving the tool takes ({given}) taken off, {taken_n:.2g} N of {range_n:.2g} N; "
        f"{np.count_nonzero(lost)} forces left out, whose motion is not known"
    ]
    for one, value in more.items():
        if of_samples and (already := recording.taken_off_already(one.name)):
            total = f"{already + value:g} in all"
            notes.append(f"its samples are recorded less {already:g} {one.unit} already: {total}")
    findings = recording.findings
    findings = findings._replace(notes=(*findings.notes, *notes))
    read = dataclasses.replace(recording, force_n=force_n, findings=findings)
    return less_empty(read, lost)


def _range(values: Any) -> float:
    """Return how far readings go apart, spikes and what is no number left out."""
    import numpy as np

    from hc_estimator.stream.readings import robust_range

    finite = values[np.isfinite(values)]
    low, high = robust_range(finite) if len(finite) else (0.0, 0.0)
    return high - low
