"""Layouts for other viewers name topics and fields that there are."""

from __future__ import annotations

import json
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
    for splitter in root.iter("DockSplitter"):
        assert int(splitter.attrib["count"]) == len(list(splitter))
