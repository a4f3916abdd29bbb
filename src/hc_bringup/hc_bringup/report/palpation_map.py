"""The palpation map: stiffness at a depth over the place, by Gaussian-process regression.

What was felt is taken in the logarithm, where its uncertainty is closest to Gaussian, each place
with the variance that its estimate states (heteroscedastic noise; Rasmussen and Williams, Gaussian
Processes for Machine Learning, section 2.2), with a Matern covariance whose amplitude and length
are fitted by the marginal likelihood. The posterior deviation says where the map is only a guess.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_bringup.dashboard.palpation import MAP_COLUMNS, PalpationMap
from hc_bringup.errors import UserError
from hc_bringup.report.contacts import Contact
from hc_bringup.run_data import RunData

Array = NDArray[np.float64]

LEAST_PLACES: Final = 4
MOST_PLACES: Final = 400
LINE_POINTS: Final = 201
PLANE_POINTS: Final = 61
SCAN_MM: Final = 2.0
"""A contact that goes sideways farther than this is felt along its way, not at one place."""
UNKNOWN_SHARE: Final = 0.8
"""Where the deviation is more than this share of that far from everything, nothing is known."""
SURE_STD: Final = 0.1
"""Where something was felt as near as its neighbours lie, and the logarithm of the stiffness is as
sure as that, it is known: tissue that is the same everywhere is so without differing from place to
place by more than the deviation, which is all that the former asks."""
AROUND: Final = 0.25
"""Quantile of the stiffness that counts as what is around a lump: the lump itself is not in it."""
AT_THE_END = 0.06
"""Share of the way: so near to its end, the stiffest place may not be the stiffest there is."""
USUAL_DEPTH_MM: Final = 2.0
DEPTHS_MM: Final = (0.2, 10.0)
"""Depths that a map is drawn for unless another one is asked for: those of a page's slider."""
_COLUMN: Final = {name: place for place, name in enumerate(MAP_COLUMNS)}


@dataclass(frozen=True)
class MeasuredPlaces:
    """Places and what was felt there.

    Attributes:
        position_mm: (n, 2).
        log_stiffness: ln of the stiffness dF/dd [N/mm] at the depth, (n,).
        variance: of it, (n,).
        deepest_mm: how deep it was pressed there, (n,).
        depth_mm: the depth.
    """

    position_mm: Array
    log_stiffness: Array
    variance: Array
    deepest_mm: Array
    depth_mm: float


class Lump(NamedTuple):
    """A hard spot.

    Attributes:
        x_mm: where.
        y_mm: where.
        factor: how many times as stiff as around it.
        deviation: standard deviation of that.
        passed: whether the tool went beyond it; if not, it may be harder further on.
    """

    x_mm: float
    y_mm: float
    factor: float
    deviation: float
    passed: bool

    def times(self) -> str:
        """Return the factor in words; what is known better than to a tenth is not shown."""
        return f"{self.factor:.1f} ± {max(0.1, 2.0 * self.deviation):.1f} times"

    def sentence(self, is_line: bool) -> str:
        """Say what was felt and where."""
        where = f"{self.x_mm:.1f} mm" if is_line else f"({self.x_mm:.1f}, {self.y_mm:.1f}) mm"
        if self.passed:
            return f"A hard spot at {where}: {self.times()} as stiff as around it"
        return f"Harder up to {where}, where the map ends: {self.times()} as stiff so far"


@dataclass(frozen=True)
class StiffnessMap:
    """The map on a grid, or along a line.

    Attributes:
        x_mm: (nx,).
        y_mm: (ny,); one value for a map along a line.
        stiffness: median [N/mm], (ny, nx).
        log_std: standard deviation of its logarithm, (ny, nx).
        known: where more is known than far from everything, or enough as it is, (ny, nx).
        places: what it is made of.
        length_mm: over which distance the tissue changes, as fitted; along x and y.
        lump: where one stands out, or None.
    """

    x_mm: Array
    y_mm: Array
    stiffness: Array
    log_std: Array
    known: NDArray[np.bool_]
    places: MeasuredPlaces
    length_mm: tuple[float, ...]
    lump: Lump | None

    @property
    def is_line(self) -> bool:
        """Whether all places lie on a line along x."""
        return len(self.y_mm) == 1

    @property
    def colour_range(self) -> tuple[float, float]:
        """What the ends of the colours mean [N/mm], by the rule of the live page (page/map.js).

        Not less than a tenth of the value, or two deviations to both sides: tissue that is the
        same everywhere has one colour, and no pattern of what nobody can know.
        """
        where = self.known if self.known.any() else np.ones_like(self.known)
        shown = self.stiffness[where]
        low, high = float(shown.min()), float(shown.max())
        middle = 0.5 * (low + high)
        usual = float(np.median(shown * self.log_std[where]))
        half = max(0.5 * (high - low), 0.05 * middle, min(2.0 * usual, middle))
        return middle - half, middle + half


def usual_depth(contacts: Sequence[Contact]) -> float:
    """Return the depth [mm] that a map is drawn for unless another one is asked for, in tenths."""
    # Depths count from where displacements do, which need not be the surface.
    deepest = [c.peak_depth_mm for c in contacts if c.peak_depth_mm > 0.0]
    half = 0.5 * float(np.median(deepest)) if deepest else USUAL_DEPTH_MM
    return max(round(min(USUAL_DEPTH_MM, half), 1), DEPTHS_MM[0])


def pressed_mm(contact: Contact) -> float:
    """Return how deep a contact went below its surface [mm], which its law counts from."""
    surface_mm = contact.surface_mm if np.isfinite(contact.surface_mm) else 0.0
    return contact.peak_depth_mm - surface_mm


def usual_map(data: RunData, contacts: Sequence[Contact]) -> StiffnessMap | None:
    """Return the map of which a report and the end of a run speak; None where there is none."""
    if data.tip is None:
        return None
    try:
        return fit_map(measured_places(data, contacts, usual_depth(contacts)))
    except UserError:
        return None  # too few places, or no library: one does without


def measured_places(data: RunData, contacts: Sequence[Contact], depth_mm: float) -> MeasuredPlaces:
    """Return where what was felt: one place a contact, or many along a scan.

    Raises:
        UserError: if there are too few places.
    """
    cell_mm = 0.5
    while True:
        cells = _cells(data, contacts, cell_mm)
        if len(cells) <= MOST_PLACES:
            break
        cell_mm *= 1.5
    if len(cells) < LEAST_PLACES:
        known = "no position is recorded (--tip TOPIC names the topic of the tip's position)"
        if data.tip is not None:
            places = "1 is" if len(cells) == 1 else f"{len(cells)} are"
            known = f"{places} known: press at more, half a millimetre apart or farther"
        raise UserError(
            f"{data.name}: a map needs contacts at {LEAST_PLACES} places at least, and {known}"
        )
    exponent = cells[:, _COLUMN["n"]]
    log_depth = float(np.log(depth_mm))
    slope = 1.0 / exponent + log_depth
    variance = (
        cells[:, _COLUMN["var_ln_K"]]
        + slope**2 * cells[:, _COLUMN["var_n"]]
        + 2.0 * slope * cells[:, _COLUMN["cov"]]
    )
    return MeasuredPlaces(
        position_mm=cells[:, [_COLUMN["x"], _COLUMN["y"]]],
        log_stiffness=cells[:, _COLUMN["ln_K"]] + np.log(exponent) + (exponent - 1.0) * log_depth,
        variance=np.maximum(variance, 1e-6),
        deepest_mm=cells[:, _COLUMN["deepest"]],
        depth_mm=depth_mm,
    )


def _cells(data: RunData, contacts: Sequence[Contact], cell_mm: float) -> Array:
    cells = PalpationMap(cell_mm, most_cells=100_000)
    for contact in contacts:
        if not np.isfinite(contact.position_mm).all():
            continue
        if contact.travel_mm <= SCAN_MM:
            _place(cells, contact.position_mm, contact)
            continue
        assert data.tip is not None
        rows = np.arange(contact.first, contact.last + 1)
        rows = rows[data.used[rows] & data.contact[rows]]
        rows = rows[:: max(1, len(rows) // 20_000)]
        x, y = (np.interp(data.time_s[rows], data.tip.time_s, a) for a in data.tip.position_mm.T)
        for row, at in zip(rows, np.column_stack([x, y]), strict=True):
            _place(cells, at, contact, int(row), data)
    table = cells.table()
    return table[np.lexsort((table[:, _COLUMN["x"]], table[:, _COLUMN["y"]]))]


def _place(
    cells: PalpationMap,
    position_mm: Array,
    contact: Contact,
    row: int | None = None,
    data: RunData | None = None,
) -> None:
    """Put what was known at the end of a contact, or at a row of it, on the map."""
    if row is None or data is None:
        parameters, covariance = contact.parameters, contact.covariance
    else:
        parameters, covariance = data.parameters[row], data.covariance[row]
    stiffness, exponent = float(parameters[0]), float(parameters[2])
    relative = float(covariance[0, 0]) / stiffness**2 if stiffness > 0.0 else np.inf
    if not (relative < 1.0 and np.isfinite(covariance[2, 2]) and exponent > 0.0):
        return
    cells.place_contact(
        float(position_mm[0]),
        float(position_mm[1]),
        np.array(
            [
                np.log(stiffness),
                exponent,
                relative,
                float(covariance[2, 2]),
                float(covariance[0, 2]) / stiffness,
            ]
        ),
        contact.peak_depth_mm,
    )


def fit_map(places: MeasuredPlaces, seed: int = 0) -> StiffnessMap:
    """Return the map through the places.

    Args:
        places: what was felt where.
        seed: of the restarts of the fit.

    Raises:
        UserError: if scikit-learn is not installed.
    """
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
    except ImportError as error:
        raise UserError("the map needs scikit-learn: pip install hc-suite[map]") from error
    spread = np.ptp(places.position_mm, axis=0)
    is_line = bool(spread[1] < 0.02 * spread[0])
    inputs = places.position_mm[:, :1] if is_line else places.position_mm
    extent = np.maximum(spread[: inputs.shape[1]], 1e-3)
    middle = float(np.median(places.log_stiffness))
    kernel = ConstantKernel(0.1, (1e-4, 1e2)) * Matern(
        0.2 * extent, [(0.02 * e, 3.0 * e) for e in extent], nu=2.5
    ) + WhiteKernel(1e-3, (1e-7, 1.0))
    process = GaussianProcessRegressor(
        kernel, alpha=places.variance, n_restarts_optimizer=2, random_state=seed
    )
    with warnings.catch_warnings():
        # A length or a noise at the end of its range is an answer, not a failure.
        warnings.simplefilter("ignore", ConvergenceWarning)
        process.fit(inputs, places.log_stiffness - middle)
    margin = 0.02 * extent
    low, high = inputs.min(axis=0) - margin, inputs.max(axis=0) + margin
    count = LINE_POINTS if is_line else PLANE_POINTS
    x = np.linspace(low[0], high[0], count)
    y = np.array([float(np.median(places.position_mm[:, 1]))])
    if not is_line:
        y = np.linspace(low[1], high[1], count)
    grid = np.column_stack([axis.ravel() for axis in np.meshgrid(x, y)])
    mean, deviation = process.predict(grid[:, : inputs.shape[1]], return_std=True)
    fitted = process.kernel_.k1
    noise = float(process.kernel_.k2.noise_level)
    # The regressor's own noise is not uncertainty of the tissue.
    deviation = np.sqrt(np.maximum(deviation**2 - noise, 0.0))
    prior = float(np.sqrt(fitted.k1.constant_value))
    shape = (len(y), len(x))
    stiffness = np.exp(mean + middle).reshape(shape)
    log_std = deviation.reshape(shape)
    resolved = log_std < UNKNOWN_SHARE * prior
    off_level = _level_std(process, grid[:, : inputs.shape[1]]).reshape(shape)
    whole_std = np.hypot(log_std, off_level)
    near = _is_near(grid[:, : inputs.shape[1]], inputs).reshape(shape)
    known = resolved | (near & (whole_std < SURE_STD))
    lengths = tuple(float(v) for v in np.atleast_1d(fitted.k2.length_scale))
    return StiffnessMap(
        x,
        y,
        stiffness,
        whole_std,
        known,
        places,
        lengths,
        _lump(  # compares places: the level is that of both
            x, y, stiffness, log_std, known, places.position_mm, is_line
        ),
    )


def _level_std(process: Any, grid: Array) -> Array:
    """Return the deviation of the map for the level around which the tissue varies, (points,).

    The level is the median of what was felt, which the regression takes for exact. It counts as far
    as the places around a point do not say what its stiffness is themselves (universal kriging;
    Rasmussen and Williams, section 2.7); that of a median is pi / 2 times the variance of a mean.

    Args:
        process: the regression, fitted.
        grid: points, (points, inputs).
    """
    white = np.linalg.solve(process.L_, np.ones(len(process.X_train_)))
    weights = np.linalg.solve(process.L_.T, white)
    left = 1.0 - process.kernel_.k1(grid, process.X_train_) @ weights
    return np.asarray(np.abs(left) * np.sqrt(0.5 * np.pi / (white @ white)))


def _is_near(grid: Array, touched_mm: Array) -> NDArray[np.bool_]:
    """Return where something was felt as near as felt places lie to each other, (points,)."""
    from scipy.spatial.distance import cdist  # slow to import, and few runs have a map

    between = cdist(touched_mm, touched_mm)
    np.fill_diagonal(between, np.inf)
    spacing = float(np.median(between.min(axis=1)))
    return np.asarray(cdist(grid, touched_mm).min(axis=1) <= spacing)


def _lump(
    x: Array,
    y: Array,
    stiffness: Array,
    log_std: Array,
    known: NDArray[np.bool_],
    touched_mm: Array,
    is_line: bool,
) -> Lump | None:
    """Return the stiffest known place if it stands out by more than its uncertainty allows."""
    if not known.any():
        return None
    usual = float(np.quantile(stiffness[known], AROUND))
    around = known & (stiffness <= usual)
    around_std = float(np.median(log_std[around]))
    low, high = touched_mm.min(axis=0), touched_mm.max(axis=0)
    within = (x >= low[0]) & (x <= high[0])
    if not is_line:
        within = within & ((y >= low[1]) & (y <= high[1]))[:, None]
    trusted = np.where(known & (log_std < 0.2) & within, stiffness, -np.inf)
    row, column = np.unravel_index(int(np.argmax(trusted)), trusted.shape)
    factor = float(trusted[row, column]) / usual
    if not factor > 1.3 or np.log(factor) < 4.0 * log_std[row, column]:
        return None
    spread = factor * float(np.hypot(log_std[row, column], around_std))
    place = np.array([x[column], y[row]])
    beyond = np.minimum(place - low, high - place) > AT_THE_END * (high - low)
    passed = bool(beyond[0] if is_line else beyond.all())
    return Lump(float(place[0]), float(place[1]), factor, spread, passed)
