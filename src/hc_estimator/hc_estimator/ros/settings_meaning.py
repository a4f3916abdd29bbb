"""What settings of the node mean together: what cannot be, the contact frame, the sensors' axes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any

from rclpy.exceptions import InvalidTopicNameException
from rclpy.validate_topic_name import validate_topic_name

from hc_estimator.ros.node_settings import MISSING_READINGS
from hc_estimator.stream import tool_motion
from hc_estimator.stream.contact_frame import (
    ContactFrame,
    Payload,
    Vector,
    unit_quaternion,
    unit_vector,
)
from hc_estimator.stream.dry_friction import DRY_FRICTION
from hc_estimator.stream.effort_filters import EffortSettings
from hc_estimator.stream.mapping import Mapping as AxisMapping
from hc_estimator.stream.mapping import make_mapping
from hc_estimator.stream.repeats import channels_held_by
from hc_estimator.stream.vocabulary import SessionSettings
from hc_msgs_py import topics

OWN_TOPICS = frozenset(
    name.strip("/")
    for name in (
        topics.SAMPLE,
        topics.ESTIMATE,
        topics.RECONSTRUCTED_WRENCH,
        topics.CONFIGURATION,
        topics.EVENTS,
        topics.CONTACTS,
        topics.DIAGNOSTICS,
    )
)


def check_together(values: Mapping[str, Any]) -> None:
    """Refuse settings that are each allowed but not together.

    Raises:
        ValueError: names the settings and what is allowed.
    """
    if values["input.maximum_gap"] <= values["input.silence_timeout"]:
        raise ValueError(
            f"parameter input.maximum_gap = {values['input.maximum_gap']!r} must be larger than "
            f"input.silence_timeout = {values['input.silence_timeout']!r}"
        )
    if values["input.pairing.maximum_wait"] <= values["input.pairing.reorder_window"]:
        raise ValueError(
            "parameter input.pairing.maximum_wait = "
            f"{values['input.pairing.maximum_wait']!r} must be larger than "
            f"input.pairing.reorder_window = {values['input.pairing.reorder_window']!r}"
        )
    if values["input.source"] == "sensors" and not values[MISSING_READINGS]:
        raise ValueError(
            f"parameter {MISSING_READINGS} = False does not go with input.source = 'sensors': its "
            "samples hold the reading of one sensor each"
        )
    if values["input.source"] == "effort" and values["input.position.type"] != "joint":
        raise ValueError(
            f"parameter input.position.type = {values['input.position.type']!r} has no effort: "
            "input.source = 'effort' needs 'joint'"
        )
    if values["input.source"] == "effort" and values["input.contact.frame"] == "surface":
        raise ValueError(
            "parameter input.contact.frame = 'surface' needs a wrench: input.source = 'effort' has "
            "none"
        )
    for setting in tool_motion.SETTINGS:
        if values[setting.name] and values["input.source"] != "sensors":
            raise ValueError(
                f"parameter {setting.name} = {values[setting.name]!r} is of input.source = "
                "'sensors', which holds readings back until their motion is known: of samples take "
                "it off where they are made, of effort say it in input.effort"
            )
    try:
        effort_settings(values)
    except ValueError as error:
        raise ValueError(f"parameter input.effort.{error}") from error
    for sensor in ("force", "position", "contact"):
        topic = values[f"input.{sensor}.topic"]
        try:
            validate_topic_name(topic)
        except InvalidTopicNameException as error:
            line = " ".join(str(error).split())
            raise ValueError(f"parameter input.{sensor}.topic = {topic!r}: {line}") from error
        if topic.strip("/") in OWN_TOPICS:
            raise ValueError(
                f"parameter input.{sensor}.topic = {topic!r} is a topic of this node: name that of "
                "the sensor"
            )
    for sensor in ("force", "position"):
        try:
            sensor_mapping(values, sensor)
        except ValueError as error:
            raise ValueError(f"parameter input.{sensor}.{error}") from error
    try:
        contact_frame(values)
    except ValueError as error:
        raise ValueError(f"parameter input.{error}") from error
    if values["input.contact.frame"] == "surface" and values["input.position.type"] == "joint":
        raise ValueError(
            "parameter input.contact.frame = 'surface' needs a pose: input.position.type = 'joint' "
            "has no attitude"
        )
    if values["input.position.type"] == "tf" and not values["input.position.child_frame"]:
        raise ValueError(
            "parameter input.position.type = 'tf' needs input.position.child_frame, the frame of "
            "the tool"
        )
    if values["input.force.topic"].strip("/") == values["input.position.topic"].strip("/"):
        raise ValueError(
            f"parameter input.position.topic = {values['input.position.topic']!r} is that of the "
            "force too: two sensors have two topics"
        )


def contact_frame(values: Mapping[str, Any]) -> ContactFrame:
    """Return the contact frame that the settings describe.

    Raises:
        ValueError: if a vector or quaternion cannot be; names the setting below `input.`.
    """

    def vector(name: str) -> Vector:
        given = values[f"input.{name}"]
        if len(given) != 3 or not all(map(math.isfinite, given)):
            raise ValueError(f"{name} = {list(given)!r} is not three finite numbers")
        return given[0], given[1], given[2]

    try:
        normal = unit_vector(values["input.contact.normal"])
    except ValueError as error:
        raise ValueError(f"contact.normal = {error}") from error
    try:
        mounting = unit_quaternion(values["input.force.mounting"])
    except ValueError as error:
        raise ValueError(f"force.mounting = {error}") from error
    return ContactFrame(
        point=vector("contact.point"),
        normal=normal,
        tip=vector("tool.tip"),
        mounting=mounting,
        in_base=values["input.force.in_base"],
        gravity=vector("gravity"),
        payload=Payload(values["input.payload.mass"], force_bias=vector("payload.force_bias")),
    )


def sensor_mapping(values: Mapping[str, Any], sensor: str) -> AxisMapping:
    """Return the mapping of one of the two sensors, "force" or "position", without its zero.

    Raises:
        ValueError: if axis, direction, sign or scale cannot be.
    """
    if sensor == "position" and values["input.position.type"] == "joint":
        axis = "x"  # a joint has one component
    else:
        axis = values[f"input.{sensor}.axis"]
    return make_mapping(
        axis,
        values[f"input.{sensor}.direction"],
        values[f"input.{sensor}.sign"],
        values[f"input.{sensor}.scale"],
        0.0,
    )


def counted_once(values: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the channels of which an input leaves readings out: repeated ones, or of friction.

    Args:
        values: settings of the node, or some of them.
    """
    source = values.get("input.source")
    if source == "effort":
        return ()
    if source != "sensors":  # samples are taken as they come
        values = {DRY_FRICTION.name: values.get(DRY_FRICTION.name)}
    return channels_held_by(values)


def session_settings(values: Mapping[str, Any]) -> SessionSettings:
    """Return the session's part of the settings."""
    return SessionSettings(
        silence_timeout_s=values["input.silence_timeout"],
        maximum_gap_s=values["input.maximum_gap"],
        rejection_burst=values["input.rejection_burst"],
        frozen_samples=values["input.frozen_samples"],
        contact_minimum_s=values["contact.minimum_duration"],
        contact_release_s=values["contact.release_time"],
    )


def effort_settings(values: Mapping[str, Any]) -> EffortSettings:
    """Return the settings of the node's parameters `input.effort.*`.

    Displacement is counted from `input.position.zero`, so there is where the tissue begins.

    Raises:
        ValueError: names what cannot be, below `input.effort.`.
    """
    names = {field.name for field in dataclasses.fields(EffortSettings)} - {"surface_mm"}
    given = {name: values[f"input.effort.{_setting(name)}"] for name in names}
    given |= {name: tuple(given[name]) for name in ("tissue", "sigma")}
    try:
        return EffortSettings(**given, surface_mm=values["input.position.zero"])
    except ValueError as error:
        name, space, rest = str(error).partition(" ")
        raise ValueError(f"{_setting(name)}{space}{rest}") from error


def _setting(name: str) -> str:
    """The node's name of a setting: its unit stands in its description."""
    for unit in ("_mm_s", "_kg", "_hz", "_mm", "_n"):
        if name.endswith(unit):
            return name.removesuffix(unit)
    return name
