"""A scenario: everything that the rig needs to know, as checked plain data from a YAML file.

Each section is a frozen dataclass whose fields carry unit and range (schema.py); a value that
cannot be is named in one line. Files live in config/scenarios; a name without a suffix is looked
up there (and in the installed copy), anything else is a path.
"""

# ruff: noqa: RUF009 - the field functions of schema.py are made for defaults

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import yaml

from hc_sim_rig.motions import ConstantVelocity, MultiSine, StepHold, Waypoints
from hc_sim_rig.schema import ScenarioError, Section, build, number, section, word

SCENARIO_FOLDER = Path(__file__).resolve().parent / "scenarios"
"""The scenarios that come with the package; config/scenarios of the checkout points here."""


@dataclass(frozen=True, kw_only=True)
class HuntCrossleyTissue(Section):
    """F = K d^n + B d^n sign(v)|v|^p (papers A, B: Eq. 1; paper C: Eq. 12 with p = 1)."""

    kind: str = word(None, "hunt_crossley")
    stiffness: float = number(None, minimum=0.0, maximum=1e6, unit="N/mm^n")
    damping: float = number(None, minimum=0.0, maximum=1e6, unit="N (s/mm)^p / mm^n")
    displacement_exponent: float = number(None, minimum=0.2, maximum=6.0)
    velocity_exponent: float = number(1.0, minimum=0.1, maximum=3.0)
    surface_mm: float = number(0.0, about="where the tissue begins", unit="mm")


@dataclass(frozen=True, kw_only=True)
class Stage(Section):
    """A position-controlled linear stage that carries the tool."""

    kind: str = word(None, "stage")
    motion: ConstantVelocity | MultiSine | StepHold | Waypoints = section()


@dataclass(frozen=True, kw_only=True)
class DisplacementSensor(Section):
    """How the displacement is read."""

    noise_std_mm: float = number(0.0, minimum=0.0, maximum=1e3, unit="mm")


@dataclass(frozen=True, kw_only=True)
class ForceSensor(Section):
    """How the force is read."""

    noise_std_n: float = number(0.0, minimum=0.0, maximum=1e3, unit="N")


@dataclass(frozen=True, kw_only=True)
class Sensors(Section):
    """Both sensors."""

    displacement: DisplacementSensor = section(DisplacementSensor)
    force: ForceSensor = section(ForceSensor)


@dataclass(frozen=True, kw_only=True)
class Scenario(Section):
    """One experiment with the rig."""

    drive: Stage = section()
    tissue: HuntCrossleyTissue = section()
    description: str = ""
    name: str = ""
    rate_hz: float = number(1000.0, minimum=1.0, maximum=20000.0, unit="Hz")
    duration_s: float = number(10.0, above=0.0, maximum=1e6, unit="s")
    at_end: str = word("stop", "stop", "loop")
    seed: int = number(1, minimum=0, maximum=2**63 - 1)
    transition_time_s: float = number(0.3, minimum=0.0, maximum=60.0, unit="s")
    sensors: Sensors = section(Sensors)

    def __post_init__(self) -> None:
        """Check what several sections say together."""
        super().__post_init__()
        if self.at_end == "loop":
            self._check_loop()

    def _check_loop(self) -> None:
        """A motion that begins anew must end where it began."""
        from hc_sim_rig.profile import profile_at

        profile = self.drive.motion.profile()
        start, _, _ = profile_at(0.0, profile.segments, profile.sines, 0)
        end, _, _ = profile_at(self.duration_s, profile.segments, profile.sines, 0)
        if abs(end - start) > 1e-3:
            raise ScenarioError(
                f"at_end is loop, but the motion ends {end - start:+.4g} mm from where it began "
                f"after duration_s {self.duration_s:g}: choose a whole period, or at_end: stop"
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
    if path.suffix not in (".yaml", ".yml") and not path.is_file():
        path = SCENARIO_FOLDER / f"{text}.yaml"
        if not path.is_file():
            raise ScenarioError(
                f"no scenario {text!r}; known: {', '.join(available_scenarios())}, "
                "or the path of a .yaml file"
            )
    try:
        data = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ScenarioError(f"cannot read scenario {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ScenarioError(f"scenario {path} is not a text file in UTF-8") from None
    except yaml.YAMLError as error:
        problem = " ".join(str(error).split())
        raise ScenarioError(f"scenario {path} is not YAML: {problem}") from None
    try:
        if isinstance(data, dict):
            data.setdefault("name", path.stem)
        return build(Scenario, data)
    except ScenarioError as error:
        raise ScenarioError(f"scenario {path.name}: {error}") from None
