"""From which step on a channel has a gap. Apart, so that who only asks this loads no scipy."""

from __future__ import annotations

from typing import Final

GAP_STEPS: Final = 5.0
"""A step of a channel so many times its usual one is a gap: a line drawn across it looks late."""
