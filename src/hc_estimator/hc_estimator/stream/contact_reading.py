"""Depth and force along the normal of a surface, of samples that hold poses and wrenches.

A wrench is turned by the attitude that the tool had at the wrench's stamp, and both readings are
taken along the normal that the surface had at theirs: interpolated between the poses around the
stamp, which the merger brings along.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from hc_estimator.stream.contact_frame import ContactFrame, Vector
from hc_estimator.stream.merger import Merged
from hc_estimator.stream.poses import (
    ToolPose,
    pose_at,
    surface_between,
    tool_between,
)


class ContactSample(NamedTuple):
    """A sample along the normal; NaN or None for a sensor without a reading.

    Attributes:
        depth_mm: how deep the tip is below the surface [mm].
        force_n: what the surface pushes back with [N].
        tip: of the tool, in the base frame [m].
        push: the force in the base frame, without weight and offset [N].
    """

    depth_mm: float
    force_n: float
    tip: Vector | None
    push: Vector | None


class ContactReading:
    """Reads samples of a tool's poses (ToolPose) and of wrenches (their force in N, a Vector).

    Attributes:
        frame: how depth and force come from them; its point and normal count where no surface
            moves.
        without_attitude: forces that were turned by the nearest attitude, for there was no pose
            on both sides of their stamp.
        without_surface: readings for which the nearest pose of the surface counts, as above.
        before_surface: samples that are none, for no pose of the surface had come.
    """

    def __init__(self, frame: ContactFrame, *, moves: bool) -> None:
        """Make a reader.

        Args:
            frame: as the attribute.
            moves: whether the samples bring poses of the surface (SurfacePose).
        """
        self.frame = frame
        self.without_attitude = self.without_surface = self.before_surface = 0
        self._moves = moves

    def read(self, sample: Merged) -> ContactSample | None:
        """Return a sample along the normal; None if nobody knows where the surface was."""
        frame = self._frame_at(sample)
        if frame is None:
            self.before_surface += 1
            return None
        tool: ToolPose | None = sample.displacement
        tip = None if tool is None else frame.tip_at(tool.place, tool.attitude)
        depth_mm = math.nan if tip is None else frame.depth_mm(tip)
        if sample.force is None:
            return ContactSample(depth_mm, math.nan, tip, None)
        then = pose_at(sample.stamp_ns, sample.displacements, tool_between)
        assert then is not None  # the stream begins with a displacement
        self.without_attitude += not (sample.displacements.is_complete or frame.in_base)
        push = frame.contact_force(sample.force, then.attitude)
        return ContactSample(depth_mm, frame.along_normal(push), tip, push)

    def _frame_at(self, sample: Merged) -> ContactFrame | None:
        if not self._moves:
            return self.frame
        surface = pose_at(sample.stamp_ns, sample.surfaces, surface_between)
        if surface is None:
            return None
        self.without_surface += not sample.surfaces.is_complete
        return self.frame._replace(point=surface.point, normal=surface.normal)
