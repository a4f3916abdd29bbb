"""Recorder and player of MCAP bags."""
