"""What stands between sensors, a stream of samples that never ends and an estimator, free of ROS.

From the sensors: mapping (axis, sign, scale, zero), contact_frame, frames, poses, contact_reading
and payload (a wrench in the frame of the contact), merger and together (two sensors with rates of
their own to one stream), tare, surface and normal_finder (force zero, contact position and normal
from an approach), effort (no force sensor), sanity with channel_checks, range_checks and
stamp_checks (readings that cannot be right), stream_guard (strays, restarts and time jumps).

To the estimates: session (one estimator under a stream, with its configuration's revisions),
vocabulary (what a session says and counts), contacts (one summary for each contact), handover (from
one estimator to another), state_file (saving and loading).
"""
