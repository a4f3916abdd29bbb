"""The ROS side of the rig's nodes, one part a file.

Modules: options and side_options (declared parameters), outputs (publishers and messages),
remote_side (the other side of a teleoperation), simulated_time (/clock and lockstep). The nodes
themselves are hc_sim_rig.node, master_node and slave_node.
"""
