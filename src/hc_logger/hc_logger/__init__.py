"""Bags: recorder and player nodes, and reading, writing, converting and recovering MCAP bags.

Modules without rclpy: definitions (message texts and hashes), metadata (metadata.yaml), writer,
mcap_file (one MCAP file, whole or cut), reader (a bag), layout (messages as numpy records),
decoder (any message as an object), csv_file, recording (what an estimator needs of a recording),
convert, info, selection, session (what the recorder keeps), playback (what the player does). Only
qos_profiles and the files named *_node.py use rclpy.
"""
