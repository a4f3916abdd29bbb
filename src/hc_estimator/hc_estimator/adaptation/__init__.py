"""Adaptation: what changes the noise, and what it does when the tissue changes."""
