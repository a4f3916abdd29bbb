"""Bags: recorder and player nodes, and reading, writing, converting and recovering MCAP bags.

Without rclpy, from the bottom up: errors, definitions (message texts and hashes), metadata
(metadata.yaml), writer; mcap_chunk, mcap_scan and mcap_file (one MCAP file, whole or cut), bag
(what every bag offers), reader (MCAP bags), foreign (bags of others), layout (messages as numpy
records), decoder (any message as an object), csv_file, recorded (a recording as plain data),
sensors (one from a wrench and a position topic), recording (one from a CSV file or a bag), convert,
recover, info, verify (exact re-estimation), selection, keyboard, reception_clock, session (what the
recorder keeps), playback (what the player does). bench starts nodes as processes.

With rclpy: recorder_node, player_node, and the folder ros.
"""

from hc_msgs_py import starting  # noqa: F401

# isort: split
from hc_msgs_py.version import VERSION

__version__ = VERSION
