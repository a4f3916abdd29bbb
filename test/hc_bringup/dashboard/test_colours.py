"""The colours of the pages can be told apart by people who see two primary colours only.

What they see: Machado, Oliveira, Fernandes (2009), A physiologically-based model for simulation of
color vision deficiency, full severity, on linear RGB. Distances are those of CIELAB (1976), where
about 2 can just be seen side by side; contrasts are those of WCAG 2.
"""

from __future__ import annotations

import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

PAGES = Path(__file__).resolve().parents[3] / "src" / "hc_bringup" / "hc_bringup"
STYLE = (PAGES / "dashboard" / "page" / "style.css").read_text(encoding="utf-8")
SEEN = {
    "all": np.eye(3),
    "protanopia": np.array(
        [
            [0.152286, 1.052583, -0.204868],
            [0.114503, 0.786281, 0.099216],
            [-0.003882, -0.048116, 1.051998],
        ]
    ),
    "deuteranopia": np.array(
        [
            [0.367322, 0.860646, -0.227968],
            [0.280085, 0.672501, 0.047413],
            [-0.011820, 0.042940, 0.968881],
        ]
    ),
}
TO_XYZ = np.array(
    [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
) / np.array([[0.95047], [1.0], [1.08883]])
LEAST_DISTANCE = 15.0
DRAWN_TOGETHER = [
    *combinations(("measured", "estimate", "truth", "accent", "alarm"), 2),
    ("good", "alarm"),
    ("good", "estimate"),
]


def linear(colour: str) -> NDArray[np.float64]:
    values = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(colour: str, seen_by: str) -> NDArray[np.float64]:
    x, y, z = TO_XYZ @ np.clip(SEEN[seen_by] @ linear(colour), 0.0, 1.0)
    fx, fy, fz = (t ** (1 / 3) if t > 0.008856 else 7.787 * t + 16 / 116 for t in (x, y, z))
    return np.array([116 * fy - 16, 500 * (fx - fy), 200 * (fy - fz)])


def distance(first: str, second: str) -> float:
    """The smallest over those who look."""
    return min(float(np.linalg.norm(lab(first, who) - lab(second, who))) for who in SEEN)


def contrast(first: str, second: str) -> float:
    low, high = sorted(float(TO_XYZ[1] @ linear(colour)) for colour in (first, second))
    return (high + 0.05) / (low + 0.05)


def palette(theme: str) -> dict[str, str]:
    block = STYLE.split(f':root[data-theme="{theme}"]' if theme == "dark" else ":root {", 1)[1]
    return dict(re.findall(r"--([a-z]+): (#[0-9a-f]{6});", block.split("}", 1)[0]))


def listed(file: str, name: str) -> list[str]:
    text = (PAGES / file).read_text(encoding="utf-8").split(f"HC.{name} = [", 1)[1]
    return re.findall(r"#[0-9a-f]{6}", text.split("]", 1)[0])


def test_the_model_of_seeing() -> None:
    """Red and green of equal lightness are far apart for most, near for a deuteranope."""
    red, green = "#c04020", "#5a7a00"
    apart = {who: np.linalg.norm(lab(red, who) - lab(green, who)) for who in SEEN}
    assert apart["deuteranopia"] < 0.3 * apart["all"]
    np.testing.assert_allclose(lab("#ffffff", "deuteranopia"), [100, 0, 0], atol=0.1)
    assert contrast("#ffffff", "#000000") == pytest.approx(21.0)


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_lines_and_words_of_the_live_page(theme: str) -> None:
    colours = palette(theme)
    for first, second in DRAWN_TOGETHER:
        assert distance(colours[first], colours[second]) >= LEAST_DISTANCE, (first, second)
    for name in ("ink", "soft", "measured", "estimate", "truth", "alarm", "warn", "good", "accent"):
        assert contrast(colours[name], colours["panel"]) >= 4.5, name  # they are words too
    # What the system chooses and what a person chooses is the same.
    assert STYLE.count(f"--accent: {colours['accent']}") == (2 if theme == "dark" else 1)


@pytest.mark.parametrize(
    ("file", "name", "count"),
    [
        ("dashboard/page/timeline.js", "HYPOTHESIS_COLOURS", 6),
        ("report/page/compare.js", "VARIANTS", 8),
        ("report/page/batch.js", "BATCH_COLOURS", 6),
    ],
)
def test_colours_of_a_list(file: str, name: str, count: int) -> None:
    colours = listed(file, name)
    assert len(colours) == count
    for first, second in combinations(colours, 2):
        assert distance(first, second) >= LEAST_DISTANCE, (first, second)
    for colour in colours:
        for theme in ("light", "dark"):
            assert contrast(colour, palette(theme)["panel"]) >= 2.2, colour
    if name == "BATCH_COLOURS":
        return  # its legend is made of the same list
    # The legend beside the charts has the same colours, in the same order.
    css = STYLE + (PAGES / "report" / "page" / "report.css").read_text(encoding="utf-8")
    prefix = r"\.variant" if name == "VARIANTS" else r"(?<!\.variant)"
    legend = re.findall(prefix + r"\.number-(\d) \{ border-color: (#[0-9a-f]{6}); \}", css)
    assert [colour for _number, colour in legend] == colours


def test_the_map_goes_from_dark_to_light_for_every_eye() -> None:
    text = (PAGES / "dashboard" / "page" / "kit.js").read_text(encoding="utf-8")
    rows = re.findall(r"\[(\d+), (\d+), (\d+)\]", text.split("HC.VIRIDIS = [", 1)[1])[:17]
    colours = ["#" + "".join(f"{int(part):02x}" for part in row) for row in rows]
    for who in SEEN:
        lightness = [lab(colour, who)[0] for colour in colours]
        assert np.all(np.diff(lightness) > 1.0), who
