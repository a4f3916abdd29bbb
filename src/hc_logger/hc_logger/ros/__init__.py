"""The ROS side of recorder and player, one part a file.

Modules: recorder_options (what the recorder is told), player_controls (the player's services),
qos_profiles (QoS as text in bags and as rclpy has it), bench (recorder and player measured as
processes). The nodes themselves are recorder_node and player_node.
"""
