"""A scenario: everything that the rig needs to know, as checked plain data from a YAML file.

Each section is a frozen dataclass whose fields carry unit and range (schema.py); a value that
cannot be is named in one line. Files live in config/scenarios; a name without a suffix is looked
up there (and in the installed copy), anything else is a path.
"""

# ruff: noqa: RUF009 - the field functions of schema.py are made for defaults

from __future__ import annotations

import difflib
from dataclasses import dataclass
from pathlib import Path

from hc_msgs_py.plain_yaml import PlainYamlError, read_plain_yaml
from hc_sim_rig.drives import Stage, Teleoperation
from hc_sim_rig.layout import HISTORY
from hc_sim_rig.motions import Motion
from hc_sim_rig.profile import profile_at
from hc_sim_rig.schema import ScenarioError, Section, build, number, section, word
from hc_sim_rig.sensors import Sensors
from hc_sim_rig.taxels import Taxels
from hc_sim_rig.tissues import HuntCrossleyTissue, Tissue
from hc_sim_rig.tissues_of_others import OURS, PROBLEMS

LOOP_TOLERANCE = 1e-3
"""[mm or N] A motion that loops may miss its beginning by this much."""

SCENARIO_FOLDER = Path(__file__).resolve().parent / "scenarios"
"""The scenarios that come with the package; config/scenarios of the checkout points here."""


@dataclass(frozen=True, kw_only=True)
class Scenario(Section):
    """One experiment with the rig."""

    drive: Stage | Teleoperation = section()
    tissue: Tissue = section()
    description: str = ""
    name: str = ""
    rate_hz: float = number(1000.0, minimum=1.0, maximum=20000.0, unit="Hz")
    substeps: int = number(2, minimum=1, maximum=1000, about="integration steps per sample")
    duration_s: float = number(10.0, above=0.0, maximum=1e6, unit="s")
    at_end: str = word("stop", "stop", "loop")
    seed: int = number(1, minimum=0, maximum=2**63 - 1)
    transition_time_s: float = number(0.3, minimum=0.0, maximum=60.0, unit="s")
    sensors: Sensors = section(Sensors)
    taxels: Taxels | None = None

    def __post_init__(self) -> None:
        """Check what several sections say together."""
        super().__post_init__()
        for name in ("displacement", "force"):
            delay = getattr(self.sensors, name).delay_s
            if delay * self.rate_hz > HISTORY - 2:
                raise ScenarioError(
                    f"sensors.{name}.delay_s is {delay:g}, must be at most "
                    f"{(HISTORY - 2) / self.rate_hz:g} s at {self.rate_hz:g} Hz"
                )
        if isinstance(self.drive, Teleoperation):
            self.drive.channel.check(self.rate_hz)
        inclusion = getattr(self.tissue, "inclusion", None)
        if inclusion is not None and getattr(self.drive, "lateral", None) is None:
            raise ScenarioError(
                "tissue.inclusion is felt by moving sideways only: name drive.lateral (of a stage)"
            )
        if self.taxels is not None and not isinstance(self.tissue, HuntCrossleyTissue):
            raise ScenarioError("taxels press on a tissue of kind hunt_crossley only")
        if self.at_end == "loop":
            self._check_loop()

    def motion(self) -> Motion:
        """Return the motion of the stage, or the profile of the operator."""
        if isinstance(self.drive, Teleoperation):
            return self.drive.operator.profile
        return self.drive.motion

    def never_happens(self) -> str:
        """Say which changes of the tissue come after the end; nothing where none does."""
        changes = getattr(self.tissue, "changes", ())
        late = [change.time_s for change in changes if change.time_s >= self.duration_s]
        if not late:
            return ""
        times = ", ".join(f"{time_s:g}" for time_s in late)
        what = "a change" if len(late) == 1 else "changes"
        ends = "ends" if self.at_end == "stop" else "begins anew"
        return (
            f"scenario {self.name}: tissue.changes has {what} at {times} s, and it {ends} at "
            f"{self.duration_s:g} s (duration_s), before that"
        )

    def _check_loop(self) -> None:
        """A motion that begins anew must end where it began."""
        motions = [self.motion()]
        lateral = getattr(self.drive, "lateral", None)
        if lateral is not None:
            motions.append(lateral)
        for motion in motions:
            profile = motion.profile()
            start, _, _ = profile_at(0.0, profile.segments, profile.sines, 0)
            end, _, _ = profile_at(self.duration_s, profile.segments, profile.sines, 0)
            if abs(end - start) > LOOP_TOLERANCE:
                raise ScenarioError(
                    f"at_end is loop, but after duration_s {self.duration_s:g} a motion is "
                    f"{end - start:+.4g} from where it began: choose a whole period, or stop"
                )


def available_scenarios() -> list[str]:
    """Names of the scenarios that come with the package."""
    return sorted(path.stem for path in SCENARIO_FOLDER.glob("*.yaml"))


def load_scenario(path_or_name: str | Path) -> Scenario:
    """Read a scenario.

    Args:
        path_or_name: a name such as "multisine", or the path of a YAML file.

    Returns:
        The checked scenario; its `name` is the file's stem unless the file gives one.

    Raises:
        ScenarioError: if there is no such scenario, if it is not YAML, or for the first key or
            value in it that cannot be. One line.
    """
    text = str(path_or_name)
    path = Path(text)
    try:
        if path.is_fifo():
            raise ScenarioError(
                f"scenario {text} is a pipe: write it to a .yaml file, and give that"
            )
        if path.suffix not in (".yaml", ".yml") and not path.is_file():
            path = SCENARIO_FOLDER / f"{text}.yaml"
            if not path.is_file():
                known = available_scenarios()
                close = difflib.get_close_matches(text, known, n=1)
                guess = f" (did you mean {close[0]}?)" if close else ""
                raise ScenarioError(
                    f"no scenario {text!r}{guess}; known: {', '.join(known)}, "
                    "or the path of a .yaml file"
                )
        data = read_plain_yaml(path)
    except OSError as error:
        raise ScenarioError(f"cannot read scenario {path}: {error.strerror}") from None
    except PlainYamlError as error:
        raise ScenarioError(f"scenario {path} is not YAML: {error}") from None
    try:
        if isinstance(data, dict):
            data.setdefault("name", path.stem)
            _refuse_broken_tissue(data.get("tissue"))
        return build(Scenario, data)
    except ScenarioError as error:
        raise ScenarioError(f"scenario {path.name}: {error}") from None


def _refuse_broken_tissue(tissue: object) -> None:
    """Say why a tissue of another package cannot be used, where a scenario asks for it."""
    kind = tissue.get("kind") if isinstance(tissue, dict) else None
    if isinstance(kind, str) and kind in PROBLEMS and kind not in OURS:
        raise ScenarioError(f"tissue {kind} cannot be used: {PROBLEMS[kind]}")
