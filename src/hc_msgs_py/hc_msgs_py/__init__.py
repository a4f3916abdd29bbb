"""ROS 2 side of the units and names: topic names, QoS profiles, SI to millimetre conversion, message to plain data."""
