"""What stands between an estimator and a stream of samples that never ends, free of ROS.

Modules: session (one estimator under a stream, with its configuration's revisions), vocabulary
(what a session says and counts), contacts (one summary for each contact), handover (from one
estimator to another), state_file (saving and loading).
"""
