"""ROS 2 side of names and units: topics, quality of service, SI to millimetres, node plumbing.

Modules: topics (names), qos (profiles), units (stamps and lengths), conversion (messages to plain
data), middleware (environment), node_main (how every node starts, spins and ends), services
(~/ready), diagnostics (1 Hz status), parameters (their declaration), interface_class (by a type's
name). Free of ROS: specification (what a parameter is), histogram (of durations), compilation (of
kernels), cdr (where the bytes of a message stand).
"""
