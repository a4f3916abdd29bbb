"""Names of the message types that the logger knows by name."""

from __future__ import annotations

SAMPLE_TYPE = "hc_msgs/msg/IndenterSample"
SAMPLES_TYPE = "hc_msgs/msg/IndenterSamples"
ESTIMATE_TYPE = "hc_msgs/msg/HuntCrossleyEstimate"
ESTIMATES_TYPE = "hc_msgs/msg/HuntCrossleyEstimates"
TACTILE_TYPE = "hc_msgs/msg/TactileSample"
TACTILE_TYPES = (TACTILE_TYPE, "hc_msgs/msg/TactileEstimate")
CONFIGURATION_TYPE = "hc_msgs/msg/EstimatorConfiguration"
EVENT_TYPE = "hc_msgs/msg/EstimatorEvent"
FORCE_TYPE = "geometry_msgs/msg/WrenchStamped"
JOINT_TYPE = "sensor_msgs/msg/JointState"
POSE_TYPE = "geometry_msgs/msg/PoseStamped"
TRANSFORM_TYPE = "geometry_msgs/msg/TransformStamped"
FRAMES_TYPE = "tf2_msgs/msg/TFMessage"
STATIC = "_static"
"""End of a topic of frames that do not move."""
POSITION_TYPES = (JOINT_TYPE, POSE_TYPE, TRANSFORM_TYPE)
