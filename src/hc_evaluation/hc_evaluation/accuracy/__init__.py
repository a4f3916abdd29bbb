"""Measures how true the estimates are, on simulated tissue and on recordings."""
