"""Tissues as a scenario names them. Their equations are in tissue_kernel.py and docs/rig.md."""

from __future__ import annotations

import dataclasses
import itertools
from dataclasses import dataclass
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from hc_sim_rig.layout import BRANCH_COLUMNS, CHANGE_COLUMNS, LAYER_COLUMNS, MAX_BRANCHES
from hc_sim_rig.schema import ScenarioError, Section, number, section, word
from hc_sim_rig.tissues_of_others import OTHERS, PARAMETERS

LEAST_EXPONENT = 0.1
"""Of a tissue that changes: with less its force jumps where contact begins."""
MM_PER_UNIT = {"mm": 1.0, "cm": 10.0}


@dataclass(frozen=True, kw_only=True)
class Change(Section):
    """Parameters that change from a time on, as factors and differences; with a duration a drift.

    Factors and differences are relative to the tissue's own values, not to an earlier change.
    """

    time_s: float = number(None, minimum=0.0, unit="s")
    duration_s: float = number(0.0, minimum=0.0, about="0 is a step", unit="s")
    stiffness_factor: float = number(1.0, minimum=0.0, maximum=1e3)
    damping_factor: float = number(1.0, minimum=0.0, maximum=1e3)
    displacement_exponent_difference: float = number(0.0, minimum=-3.0, maximum=3.0)
    velocity_exponent_difference: float = number(0.0, minimum=-2.0, maximum=2.0)


@dataclass(frozen=True, kw_only=True)
class Inclusion(Section):
    """Something stiff under the surface, felt as a bell while the tool scans sideways."""

    centre_mm: float = number(None, about="sideways", unit="mm")
    width_mm: float = number(None, above=0.0, about="standard deviation of the bell", unit="mm")
    stiffness_factor: float = number(None, minimum=0.0, maximum=1e3, about="at the centre")
    damping_factor: float = number(1.0, minimum=0.0, maximum=1e3, about="at the centre")


@dataclass(frozen=True, kw_only=True)
class HuntCrossleyTissue(Section):
    """F = max(0, K d^n + B d^n sign(v)|v|^p) (papers A, B: Eq. 1; paper C: Eq. 12 with p = 1).

    The kind `adhesive` leaves out the max(): a tip that withdraws quickly is held back, as the
    papers' formula says and as only a tissue that sticks to the tip could do.
    """

    PRESETS: ClassVar[dict[str, dict[str, Any]]] = {
        # Silicone Ecoflex 0030 under a round tip of 5 mm diameter (paper A, section 5.4):
        # Hertz, K = 4/3 E / (1 - 1/4) sqrt(2.5 mm), with E = 69 kPa (10 psi, the maker's modulus
        # at 100 % strain), n = 1.5; B/K = 0.011 as the soft phantom of ../shared/data.
        "ecoflex_0030": {
            "stiffness": 0.194,
            "damping": 0.0021,
            "displacement_exponent": 1.5,
            "velocity_exponent": 1.0,
        },
    }

    kind: str = word(None, "hunt_crossley", "adhesive")
    preset: str = word("none", "none", "ecoflex_0030")
    length_unit: str = word("mm", "mm", "cm", about="unit of K and B")
    stiffness: float = number(None, minimum=0.0, maximum=1e6, unit="N/mm^n")
    damping: float = number(None, minimum=0.0, maximum=1e6, unit="N (s/mm)^p / mm^n")
    displacement_exponent: float = number(None, minimum=0.2, maximum=6.0)
    velocity_exponent: float = number(1.0, minimum=0.1, maximum=3.0)
    surface_mm: float = number(0.0, about="where the tissue begins", unit="mm")
    inclusion: Inclusion | None = None
    changes: tuple[Change, ...] = section(tuple)

    def __post_init__(self) -> None:
        """Check that every change follows the one before it and stays in range."""
        super().__post_init__()
        check_changes(self.changes, self.displacement_exponent, self.velocity_exponent)

    def values(self) -> tuple[float, float, float, float]:
        """K, B, n, p in mm, s and N."""
        unit = MM_PER_UNIT[self.length_unit]
        n, p = self.displacement_exponent, self.velocity_exponent
        return self.stiffness / unit**n, self.damping / unit ** (n + p), n, p


@dataclass(frozen=True, kw_only=True)
class KelvinVoigtTissue(Section):
    """F = K d + B v while the tip is below the surface, never pulling."""

    kind: str = word(None, "kelvin_voigt")
    stiffness: float = number(None, minimum=0.0, maximum=1e6, unit="N/mm")
    damping: float = number(None, minimum=0.0, maximum=1e6, unit="N s/mm")
    surface_mm: float = number(0.0, about="where the tissue begins", unit="mm")
    changes: tuple[Change, ...] = section(tuple)

    def __post_init__(self) -> None:
        """Check that every change follows the one before it."""
        super().__post_init__()
        check_changes(self.changes, 1.0, 1.0)
        for change in self.changes:
            if change.displacement_exponent_difference or change.velocity_exponent_difference:
                raise ScenarioError("changes names an exponent, which kelvin_voigt does not have")

    def values(self) -> tuple[float, float, float, float]:
        """K, B and the exponents 1 of the linear law."""
        return self.stiffness, self.damping, 1.0, 1.0


@dataclass(frozen=True, kw_only=True)
class Branch(Section):
    """A spring and a dashpot in series."""

    stiffness_ratio: float = number(None, above=0.0, maximum=1e3, about="spring relative to K")
    time_constant_s: float = number(None, minimum=1e-3, maximum=1e4, unit="s")


@dataclass(frozen=True, kw_only=True)
class ViscoelasticTissue(Section):
    """Springs of one exponent with dashpots: standard linear solid (one branch) or Prony.

    F = K d^n + sum_i r_i K sign(d - z_i) |d - z_i|^n, dz_i/dt = (d - z_i) / tau_i. Held at a
    depth, branch i relaxes as exp(-n t / tau_i). A plant that Hunt-Crossley cannot represent.
    """

    kind: str = word(None, "viscoelastic")
    stiffness: float = number(None, above=0.0, maximum=1e6, about="after relaxation", unit="N/mm^n")
    displacement_exponent: float = number(1.0, minimum=0.2, maximum=6.0)
    branches: tuple[Branch, ...] = section()
    surface_mm: float = number(0.0, about="where the tissue begins", unit="mm")

    def __post_init__(self) -> None:
        """Check the number of branches."""
        super().__post_init__()
        if not 1 <= len(self.branches) <= MAX_BRANCHES:
            raise ScenarioError(
                f"branches has {len(self.branches)} entries, must have 1 to {MAX_BRANCHES}"
            )

    def values(self) -> tuple[float, float, float, float]:
        """K, no B, n, and an exponent without meaning."""
        return self.stiffness, 0.0, self.displacement_exponent, 1.0


THINNEST_LAYER_MM: Final = 1e-6
"""A nanometre; the stiffness is the force at rupture over a power of the stretch until there."""


@dataclass(frozen=True, kw_only=True)
class Layer(Section):
    """A layer that a needle stretches from a depth on until it ruptures."""

    start_mm: float = number(None, minimum=0.0, unit="mm")
    rupture_mm: float = number(None, above=0.0, unit="mm")
    peak_n: float = number(None, above=0.0, maximum=1e4, about="elastic force at rupture", unit="N")
    exponent: float = number(2.0, minimum=0.2, maximum=6.0)


@dataclass(frozen=True, kw_only=True)
class LayeredTissue(Section):
    """Layers with ruptures, friction on the shaft and cutting at the tip (needle insertion)."""

    kind: str = word(None, "layered")
    layers: tuple[Layer, ...] = section()
    rupture_time_s: float = number(0.02, minimum=1e-4, maximum=10.0, unit="s")
    shaft_friction_n_per_mm: float = number(0.0, minimum=0.0, maximum=100.0, unit="N/mm")
    cutting_force_n: float = number(0.0, minimum=0.0, maximum=100.0, unit="N")
    surface_mm: float = number(0.0, about="where the tissue begins", unit="mm")

    def __post_init__(self) -> None:
        """Check that there are layers, one below the other."""
        super().__post_init__()
        if not self.layers:
            raise ScenarioError("layers is empty, must have at least one layer")
        for layer in self.layers:
            if layer.rupture_mm - layer.start_mm < THINNEST_LAYER_MM:
                raise ScenarioError(
                    f"layers has one that ruptures at {layer.rupture_mm:g} mm, must be at least "
                    f"{THINNEST_LAYER_MM:g} mm deeper than its start {layer.start_mm:g} mm"
                )
        for upper, lower in itertools.pairwise(self.layers):
            if lower.rupture_mm <= upper.rupture_mm:
                raise ScenarioError(
                    f"layers has a rupture at {lower.rupture_mm:g} mm after the one at "
                    f"{upper.rupture_mm:g} mm, must be deeper"
                )

    def values(self) -> tuple[float, float, float, float]:
        """No K, B, n, p: placeholders that the layered kernel does not read."""
        return 0.0, 0.0, 1.0, 1.0


@dataclass(frozen=True, kw_only=True)
class NoTissue(Section):
    """Free space."""

    kind: str = word(None, "none")
    surface_mm: float = number(0.0, about="where displacement counts from", unit="mm")

    def values(self) -> tuple[float, float, float, float]:
        """Nothing resists."""
        return 0.0, 0.0, 1.0, 1.0


@dataclass(frozen=True, kw_only=True)
class TissueOfOthers(Section):
    """A tissue of another package, with the meaning of K, B, n and p that it gives them."""

    kind: str = word(None, *OTHERS)
    stiffness: float = number(0.0, minimum=0.0, maximum=1e6)
    damping: float = number(0.0, minimum=0.0, maximum=1e6)
    displacement_exponent: float = number(1.0, minimum=0.2, maximum=6.0)
    velocity_exponent: float = number(1.0, minimum=0.1, maximum=3.0)
    surface_mm: float = number(0.0, about="where the tissue begins", unit="mm")
    inclusion: Inclusion | None = None
    changes: tuple[Change, ...] = section(tuple)

    def __post_init__(self) -> None:
        """Check that nothing is given that it does not have, and its changes."""
        super().__post_init__()
        if self.kind not in OTHERS:
            raise ScenarioError(f"kind is {self.kind!r}, and no package has brought such a tissue")
        defaults = {field.name: field.default for field in dataclasses.fields(self)}
        for name in PARAMETERS:
            has = name in OTHERS[self.kind].parameters
            if not has and getattr(self, name) != defaults[name]:
                raise ScenarioError(f"{name} is given, which the tissue {self.kind} does not have")
        check_changes(self.changes, self.displacement_exponent, self.velocity_exponent)

    def values(self) -> tuple[float, float, float, float]:
        """K, B, n, p."""
        return (
            self.stiffness,
            self.damping,
            self.displacement_exponent,
            self.velocity_exponent,
        )


Tissue = (
    HuntCrossleyTissue
    | KelvinVoigtTissue
    | ViscoelasticTissue
    | LayeredTissue
    | NoTissue
    | TissueOfOthers
)


def check_changes(
    changes: tuple[Change, ...], displacement_exponent: float, velocity_exponent: float
) -> None:
    """Raise ScenarioError unless changes are in order and keep the exponents positive."""
    for change in changes:
        for name, value in (
            ("displacement_exponent", displacement_exponent),
            ("velocity_exponent", velocity_exponent),
        ):
            after = round(value + getattr(change, f"{name}_difference"), 9)  # 0.3 - 0.2 < 0.1
            if after < LEAST_EXPONENT:
                raise ScenarioError(
                    f"changes makes {name} {after:g}, must stay >= {LEAST_EXPONENT:g}"
                )
    for earlier, later in itertools.pairwise(changes):
        if later.time_s < earlier.time_s + earlier.duration_s:
            raise ScenarioError(
                f"changes has one at {later.time_s:g} s while the one of {earlier.time_s:g} s "
                f"still lasts (until {earlier.time_s + earlier.duration_s:g} s)"
            )


def change_table(tissue: Tissue) -> NDArray[np.float64]:
    """(E, CHANGE_COLUMNS) table of the changes in time."""
    changes = getattr(tissue, "changes", ())
    rows = [
        (
            change.time_s,
            change.duration_s,
            change.stiffness_factor,
            change.damping_factor,
            change.displacement_exponent_difference,
            change.velocity_exponent_difference,
        )
        for change in changes
    ]
    return np.array(rows, dtype=np.float64).reshape(-1, CHANGE_COLUMNS)


def layer_table(tissue: Tissue) -> NDArray[np.float64]:
    """(L, LAYER_COLUMNS) table of the layers; stiffness follows from the force at rupture."""
    rows = []
    if isinstance(tissue, LayeredTissue):
        for layer in tissue.layers:
            stretch = layer.rupture_mm - layer.start_mm
            stiffness = layer.peak_n / stretch**layer.exponent
            rows.append((layer.start_mm, layer.rupture_mm, stiffness, layer.exponent))
    return np.array(rows, dtype=np.float64).reshape(-1, LAYER_COLUMNS)


def branch_table(tissue: Tissue) -> NDArray[np.float64]:
    """(M, BRANCH_COLUMNS) table of the viscoelastic branches."""
    rows = []
    if isinstance(tissue, ViscoelasticTissue):
        rows = [(branch.stiffness_ratio, branch.time_constant_s) for branch in tissue.branches]
    return np.array(rows, dtype=np.float64).reshape(-1, BRANCH_COLUMNS)
