"""The state spaces, one file each, and their registry."""
