"""Layouts for other viewers name topics and fields that there are."""

from __future__ import annotations

import json
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

from hc_logger.definitions import installed_definition
from hc_logger.layout import record_dtype

LAYOUTS = Path(__file__).resolve().parents[2] / "config" / "layouts"
TYPES = {
    "/hc/estimate": "hc_msgs/msg/HuntCrossleyEstimate",
    "/indenter/truth": "hc_msgs/msg/IndenterTruth",
}


def exists(topic: str, field: str) -> bool:
    return field in (record_dtype(installed_definition(TYPES[topic]), 1).names or ())


def leaves(layout: Any) -> list[str]:
    if isinstance(layout, str):
        return [layout]
    return [*leaves(layout["first"]), *leaves(layout["second"])]


def test_foxglove_layout() -> None:
    content = json.loads((LAYOUTS / "foxglove.json").read_text(encoding="utf-8"))
    panels = content["configById"]
    assert sorted(leaves(content["layout"])) == sorted(panels)
    paths = [path["value"] for panel in panels.values() for path in panel.get("paths", [])]
    paths += [panel["xAxisPath"]["value"] for panel in panels.values() if "xAxisPath" in panel]
    assert len(paths) > 20
    for name, panel in panels.items():
        # Studio's window follows its clock: stamps of a replayed bag lie hours before it.
        assert all(p["timestampMethod"] == "receiveTime" for p in panel.get("paths", [])), name
        assert panel.get("legendDisplay", "none") in ("left", "none"), "not over the data"
        if panel.get("xAxisVal") == "custom":
            assert "followingViewWidth" not in panel, "a width in seconds, on an axis of metres"
    for path in paths:
        topic, _, field = path.partition(".")
        assert exists(topic, field), path


def test_plotjuggler_layout() -> None:
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    curves = [curve.attrib["name"] for curve in root.iter("curve")]
    assert len(curves) > 15
    for curve in curves:
        topic, _, field = curve.rpartition("/")
        assert exists(topic, field), curve
    # As PlotJuggler reads it (plot_docker.cpp, plotwidget.cpp): anything else is left out silently.
    assert [child.tag for child in root][:1] == ["tabbed_widget"]
    for tab in root.iter("Tab"):
        assert len(tab.findall("Container")) == int(tab.attrib["containers"]) == 1
        assert [child.tag for child in tab[0]] == ["DockSplitter"]
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.attrib["count"]) == len(list(splitter))
        assert splitter.attrib["orientation"] in ("|", "-")
        sizes = [float(size) for size in splitter.attrib["sizes"].split(";")]
        assert len(sizes) == len(list(splitter))  # fewer would end the program
        assert abs(sum(sizes) - 1.0) < 1e-3
        assert {child.tag for child in splitter} <= {"DockSplitter", "DockArea"}
    for area in root.iter("DockArea"):
        assert [child.tag for child in area] == ["plot"]
        assert area.attrib["name"]
        assert area[0].attrib["mode"] == "TimeSeries"
        for curve in area[0].iter("curve"):
            assert re.fullmatch("#[0-9a-f]{6}", curve.attrib["color"])
