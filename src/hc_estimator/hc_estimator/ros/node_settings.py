"""Settings of the node itself, as a table: how it takes its input, watches it and reports."""

from __future__ import annotations

from hc_estimator.ros.effort_settings import EFFORT_SETTINGS
from hc_estimator.ros.sensor_settings import sensor_settings
from hc_estimator.stream import dry_friction, frame_compliance, tool_motion
from hc_estimator.stream.merger import MAXIMUM_WAIT_S
from hc_estimator.stream.vocabulary import SessionSettings
from hc_msgs_py.specification import ParameterSpecification, setting

LARGEST_BACKLOG = 20_000
"""Samples that may wait: in arrays they are fewer messages than a queue holds."""

CHOICE_NAMES = ("filter", "state_space", "contact_model")
MISSING_READINGS = "missing_readings"

OWN_SENSORS = ("sensors", "effort")
"""Sources of which the node makes samples itself: of now, and published with zeros taken off."""

NEEDS_OTHER_SUBSCRIPTIONS = frozenset(
    (
        "input.source",
        "input.force.topic",
        "input.position.topic",
        "input.position.type",
        "input.publish_samples",
        "input.contact.frame",
        "input.contact.normal_from",
        "input.contact.topic",
    )
)


READING = frozenset(
    (
        "input.source",
        "input.position.type",
        "input.position.joint",
        "input.position.child_frame",
        "input.position.base_frame",
        frame_compliance.SETTING.name,
        *(setting.name for setting in (*dry_friction.SETTINGS, *tool_motion.SETTINGS)),
        "input.contact.frame",
        "input.contact.point",
        "input.contact.normal",
        "input.contact.normal_from",
        "input.contact.topic",
        "input.tool.tip",
        "input.force.mounting",
        "input.force.in_base",
        "input.payload.mass",
        "input.payload.force_bias",
        "input.gravity",
        *(
            f"input.{sensor}.{name}"
            for sensor in ("force", "position")
            for name in (
                "topic",
                "axis",
                "direction",
                "sign",
                "scale",
                "zero",
                "time_offset",
                "held",
                "stamps",
            )
        ),
        *(setting.name for setting in EFFORT_SETTINGS),
    )
)
"""Settings that say how a sensor is read: what was learnt with others belongs to other readings."""


def _table(*settings: ParameterSpecification) -> dict[str, ParameterSpecification]:
    return {s.name: s for s in settings}


NODE_SETTINGS = _table(
    setting(
        "carry_over",
        True,
        "A change of filter, state_space or contact_model keeps the parameters and their "
        "covariance; false starts afresh.",
    ),
    setting(
        "input.source",
        "sample",
        "sample: the topic indenter/sample; samples: indenter/samples, many in a message; sensors: "
        "a force and a position sensor of one's own; effort: a joint's position and motor effort, "
        "no force sensor.",
        choices=("sample", "samples", "sensors", "effort"),
    ),
    *sensor_settings(
        "force",
        "ft_sensor/wrench",
        "Force that counts as zero; ~/tare sets it",
        "N",
        "geometry_msgs/WrenchStamped",
    ),
    *sensor_settings(
        "position",
        "joint_states",
        "Position of the surface, where contact begins; ~/tare sets it",
        "mm",
        "the type that input.position.type says",
    ),
    frame_compliance.SETTING,
    *dry_friction.SETTINGS,
    *tool_motion.SETTINGS,
    *EFFORT_SETTINGS,
    setting(
        "input.position.type",
        "joint",
        "joint: sensor_msgs/JointState; pose: geometry_msgs/PoseStamped; transform: "
        "geometry_msgs/TransformStamped; tf: a frame of /tf (tf2_msgs/TFMessage).",
        choices=("joint", "pose", "transform", "tf"),
    ),
    setting(
        "input.position.joint",
        "",
        "Name of the joint for type joint; empty takes the first one of the message.",
    ),
    setting(
        "input.position.child_frame",
        "",
        "For type transform: only transforms of this child frame; empty takes all. For type tf: "
        "the tool's frame.",
    ),
    setting(
        "input.position.base_frame",
        "",
        "For type tf: the frame in which the tool's position is told; empty takes the one that "
        "the tool's frame hangs on.",
    ),
    setting(
        "input.contact.frame",
        "sensor",
        "sensor: depth and force along axes of their sensors; surface: along the normal of a "
        "surface, the wrench turned by the pose's attitude and freed of the payload's weight.",
        choices=("sensor", "surface"),
    ),
    setting(
        "input.contact.point",
        [0.0, 0.0, 0.0],
        "A point of the surface in the base frame, that of the pose; its position.zero adds [m].",
    ),
    setting(
        "input.contact.normal",
        [0.0, 0.0, 1.0],
        "Normal of the surface, out of the tissue, in the base frame; any length.",
    ),
    setting(
        "input.contact.normal_from",
        "setting",
        "Where the normal comes from: setting: input.contact.normal; topic: the z axis of a pose; "
        "find_surface: the direction in which the tissue pushes during ~/find_surface.",
        choices=("setting", "topic", "find_surface"),
    ),
    setting(
        "input.contact.topic",
        "surface_pose",
        "Topic of the surface's pose, geometry_msgs/PoseStamped: point and normal (z axis).",
    ),
    setting(
        "input.tool.tip",
        [0.0, 0.0, 0.0],
        "Tip of the tool in the frame of the pose [m]; for contact frame surface.",
    ),
    setting(
        "input.force.mounting",
        [0.0, 0.0, 0.0, 1.0],
        "Attitude of the force sensor in the frame of the pose, quaternion x, y, z, w.",
    ),
    setting(
        "input.force.in_base",
        False,
        "The wrench comes in the base frame already (Franka's external wrench, say).",
    ),
    setting(
        "input.payload.mass",
        0.0,
        "What hangs on the force sensor; below zero where its driver takes too much off. "
        "`hc payload` identifies it.",
        minimum=-1.0,
        maximum=1000.0,
        unit="kg",
    ),
    setting(
        "input.payload.force_bias",
        [0.0, 0.0, 0.0],
        "Reading of the force sensor without load, in its frame [N].",
    ),
    setting(
        "input.gravity",
        [0.0, 0.0, -9.81],
        "Gravity in the base frame [m/s^2].",
    ),
    setting(
        "input.pairing.maximum_wait",
        MAXIMUM_WAIT_S,
        "A reading waits no longer than this for older ones of the other sensor; those that come "
        "later are dropped. The slower sensor's delay and period must fit in.",
        minimum=0.0,
        maximum=10.0,
        unit="s",
    ),
    setting(
        "input.pairing.reorder_window",
        0.0,
        "Every reading waits so long for messages that come out of order; adds to the latency.",
        minimum=0.0,
        maximum=10.0,
        unit="s",
    ),
    setting(
        "input.pairing.maximum_gap",
        0.1,
        "A reading further than this from any of the other sensor is dropped: one sensor alone "
        "says nothing of a tissue.",
        minimum=0.0001,
        maximum=10.0,
        unit="s",
    ),
    setting(
        "input.publish_samples",
        True,
        "With source sensors or effort: publish the samples made of them on indenter/sample, to "
        "record and plot.",
    ),
    setting(
        "input.silence_timeout",
        SessionSettings.silence_timeout_s,
        "Without a sample for so long the input counts as silent.",
        minimum=0.01,
        maximum=3600.0,
        unit="s",
    ),
    setting(
        "input.maximum_gap",
        SessionSettings.maximum_gap_s,
        "Stamps further ahead than this are a time jump and start the estimator afresh.",
        minimum=0.01,
        maximum=1e6,
        unit="s",
    ),
    setting(
        "input.maximum_backlog",
        1000,
        "When more samples wait, the node skips to the latest ones and counts the skipped. Of "
        "messages with a sample each no more than 2000 ever wait.",
        minimum=1,
        maximum=LARGEST_BACKLOG,
        unit="samples",
    ),
    setting(
        "input.rejection_burst",
        SessionSettings.rejection_burst,
        "So many samples refused in a row are an event and a warning.",
        minimum=1,
        maximum=1000000,
        unit="samples",
    ),
    setting(
        "input.frozen_samples",
        SessionSettings.frozen_samples,
        "So many equal readings in a row are an event and a warning.",
        minimum=2,
        maximum=1000000,
        unit="samples",
    ),
    setting(
        "contact.minimum_duration",
        SessionSettings.contact_minimum_s,
        "Shorter touches are not reported.",
        minimum=0.0,
        maximum=3600.0,
        unit="s",
    ),
    setting(
        "contact.release_time",
        SessionSettings.contact_release_s,
        "The tool must be away so long for a contact to be over.",
        minimum=0.0,
        maximum=3600.0,
        unit="s",
    ),
    setting(
        "expected_sample_publishers",
        1,
        "Publishers of the input that ~/ready waits for.",
        minimum=0,
        maximum=1000,
    ),
    setting(
        "expected_estimate_subscribers",
        0,
        "Subscribers of hc/estimate that ~/ready waits for, and the first sample that is made of "
        "sensors (5 s at most).",
        minimum=0,
        maximum=1000,
    ),
    setting(
        "expected_sample_subscribers",
        -1,
        "The same of samples made of sensors; -1: the first one waits for one subscriber where "
        "those of estimates are expected, ~/ready for none.",
        minimum=-1,
        maximum=1000,
    ),
    setting(
        "output.estimates",
        "each",
        "each: a message on hc/estimate for every sample; arrays: one on hc/estimates for all "
        "samples that came together; both.",
        choices=("each", "arrays", "both"),
    ),
    setting(
        "tare.samples",
        500,
        "Samples that ~/tare takes the means of.",
        minimum=1,
        maximum=1000000,
    ),
    setting(
        "tare.force",
        False,
        "Take zeros although the tool presses or moves: ~/tare and ~/find_surface refuse it "
        "otherwise.",
    ),
    setting(
        "state.folder",
        "",
        "Folder for ~/save, ~/load and the state kept for a restart; empty switches these off.",
        read_only=True,
    ),
    setting(
        "state.autosave_period",
        1.0,
        "The state is kept this often, so that a node that died goes on; 0 switches it off.",
        minimum=0.0,
        maximum=3600.0,
        unit="s",
    ),
    setting(
        "state.maximum_age",
        30.0,
        "A state that was kept longer ago is not gone on from at start.",
        minimum=0.0,
        maximum=1e6,
        unit="s",
    ),
    setting(
        "autostart",
        True,
        "Configure and activate at start; false leaves both to a lifecycle manager.",
        read_only=True,
    ),
)
