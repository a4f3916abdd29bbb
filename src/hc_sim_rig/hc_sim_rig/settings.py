"""Settings that may change while the rig runs: their names, ranges, and where they apply."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from hc_msgs_py.specification import ParameterSpecification
from hc_sim_rig.drives import Channel, Teleoperation
from hc_sim_rig.layout import (
    TUNE_AMPLITUDE,
    TUNE_BACKWARD_DELAY,
    TUNE_DAMPING,
    TUNE_DISPLACEMENT_EXPONENT,
    TUNE_DISPLACEMENT_NOISE,
    TUNE_FEEDBACK_GAIN,
    TUNE_FORCE_NOISE,
    TUNE_FORWARD_DELAY,
    TUNE_SPEED,
    TUNE_STIFFNESS,
    TUNE_TISSUE_SCALE,
    TUNE_VELOCITY_EXPONENT,
)
from hc_sim_rig.scenario import Scenario
from hc_sim_rig.schema import ScenarioError
from hc_sim_rig.tissues import LEAST_EXPONENT
from hc_sim_rig.tissues_of_others import OTHERS


class Setting(NamedTuple):
    """A setting that may change while the rig runs.

    Attributes:
        row: its place in what the kernels read.
        specification: what it may be; its default is that of the scenario.
    """

    row: int
    specification: ParameterSpecification


def _settings(
    *rows: tuple[str, int, float, float, str, str],
) -> dict[str, Setting]:
    return {
        name: Setting(
            row,
            ParameterSpecification(
                name, "float", 0.0, about, minimum=minimum, maximum=maximum, unit=unit
            ),
        )
        for name, row, minimum, maximum, unit, about in rows
    }


SETTINGS: Mapping[str, Setting] = _settings(
    ("speed", TUNE_SPEED, 0.0, 10.0, "1", "pace of the motion; 0 stands still"),
    ("amplitude", TUNE_AMPLITUDE, 0.0, 10.0, "1", "scale of the motion or the force"),
    (
        "displacement_noise_std_mm",
        TUNE_DISPLACEMENT_NOISE,
        0.0,
        1e3,
        "mm",
        "noise of the displacement sensor",
    ),
    ("force_noise_std_n", TUNE_FORCE_NOISE, 0.0, 1e3, "N", "noise of the force sensor"),
    ("tissue_scale", TUNE_TISSUE_SCALE, 0.0, 1e3, "1", "factor on the tissue's forces"),
    ("stiffness", TUNE_STIFFNESS, 0.0, 1e6, "N/mm^n", "tissue parameter K"),
    ("damping", TUNE_DAMPING, 0.0, 1e6, "N (s/mm)^p / mm^n", "tissue parameter B"),
    ("displacement_exponent", TUNE_DISPLACEMENT_EXPONENT, 0.2, 6.0, "1", "tissue parameter n"),
    ("velocity_exponent", TUNE_VELOCITY_EXPONENT, 0.1, 3.0, "1", "tissue parameter p"),
    ("feedback_gain", TUNE_FEEDBACK_GAIN, 0.0, 1e3, "1", "k_f of the master's controller"),
    ("forward_delay_s", TUNE_FORWARD_DELAY, 0.0, 2.0, "s", "delay from master to slave"),
    ("backward_delay_s", TUNE_BACKWARD_DELAY, 0.0, 2.0, "s", "delay from slave to master"),
)

_EVERYWHERE = ("speed", "amplitude", "displacement_noise_std_mm", "force_noise_std_n")
_HUNT_CROSSLEY = (
    "tissue_scale",
    "stiffness",
    "damping",
    "displacement_exponent",
    "velocity_exponent",
)
_TISSUE = {
    "none": (),
    "hunt_crossley": _HUNT_CROSSLEY,
    "adhesive": _HUNT_CROSSLEY,
    "kelvin_voigt": ("tissue_scale", "stiffness", "damping"),
    "viscoelastic": ("tissue_scale", "stiffness", "displacement_exponent"),
    "layered": ("tissue_scale",),
    **{name: entry.parameters for name, entry in OTHERS.items()},
}
_TELEOPERATION = ("feedback_gain", "forward_delay_s", "backward_delay_s")


def settings_of(scenario: Scenario) -> dict[str, Setting]:
    """Settings that a scenario has, by name."""
    names = _EVERYWHERE + _TISSUE[scenario.tissue.kind]
    if isinstance(scenario.drive, Teleoperation):
        names += _TELEOPERATION
    return {name: SETTINGS[name] for name in names}


def check_settings(scenario: Scenario, values: Mapping[str, float]) -> None:
    """Check new values of settings.

    Args:
        scenario: the scenario that runs.
        values: new values by name.

    Raises:
        ScenarioError: names the first setting that does not exist here or is out of range.
    """
    known = settings_of(scenario)
    for name, value in values.items():
        if name not in known:
            raise ScenarioError(f"this scenario has no setting {name!r}; known: {', '.join(known)}")
        try:
            known[name].specification.checked(value)
        except ValueError as error:
            raise ScenarioError(str(error)) from None
    changes = getattr(scenario.tissue, "changes", ())
    for name in {"displacement_exponent", "velocity_exponent"} & values.keys():
        differences = [getattr(change, f"{name}_difference") for change in changes]
        lowest = round(values[name] + min(differences, default=0.0), 9)
        if lowest < LEAST_EXPONENT:
            raise ScenarioError(
                f"{name} = {values[name]:g} would be {lowest:g} after the scenario's changes, "
                f"must stay >= {LEAST_EXPONENT:g}"
            )
    if isinstance(scenario.drive, Teleoperation):
        _check_delays(scenario.drive.channel, values, scenario.rate_hz)


def _check_delays(channel: Channel, values: Mapping[str, float], rate_hz: float) -> None:
    """Raise ScenarioError where packets could travel longer than the rig can keep them."""
    for side in ("forward", "backward"):
        wanted = values.get(f"{side}_delay_s")
        if wanted is not None:
            channel.check_link(side, rate_hz, wanted - getattr(channel, side).delay_s)
