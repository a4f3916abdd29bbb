"""Simulated master-slave indenter, and its node."""
