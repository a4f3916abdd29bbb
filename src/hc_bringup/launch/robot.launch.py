"""Estimator and recorder on the sensors of a robot, for a ROS 2 installation with launch.

ros2 launch hc_bringup robot.launch.py params_file:=my_robot.yaml bag:=bags/today
"""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription


def generate_launch_description() -> LaunchDescription:
    """Return the two nodes; the parameter file is one that `hc setup` wrote, or a copy of one."""
    recorder = {
        "output": LaunchConfiguration("bag"),
        "topics": ["*"],
        "exclude": ["/parameter_events", "/rosout", "/hc/reconstructed_wrench"],
        "when_exists": "number",
        "expected_topics": ["hc/estimate"],
    }
    return LaunchDescription(
        [
            DeclareLaunchArgument("params_file", description="parameters of the estimator"),
            DeclareLaunchArgument("bag", default_value="bags/run", description="folder of the bag"),
            Node(
                package="hc_estimator",
                executable="estimator",
                name="estimator",
                parameters=[LaunchConfiguration("params_file")],
                respawn=True,
                output="screen",
            ),
            Node(
                package="hc_logger",
                executable="recorder",
                name="recorder",
                parameters=[recorder],
                output="screen",
            ),
        ]
    )
