"""The ROS side of recorder and player, one part a file.

Modules: player_controls (the player's services), qos_profiles (QoS as text in bags and as rclpy has
it). The nodes themselves are hc_logger.recorder_node and player_node.
"""
