"""What stands between sensors and an estimator, free of ROS.

Modules: stream_guard (strays, restarts and time jumps in a stream of samples), mapping (axis,
sign, scale, zero), pairing (two sensors with clocks of their own to one stream), tare, surface
(force zero and contact position from an approach).
"""
