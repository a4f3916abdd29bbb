"""What stands between sensors and an estimator, free of ROS.

Modules: stream_guard (strays, restarts and time jumps in a stream of samples), mapping (axis,
sign, scale, zero), merger (two sensors with rates of their own to one stream), together (force with
the displacement at its stamp), tare, surface (force zero and contact position from an approach).
"""
