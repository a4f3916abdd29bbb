"""Feedback methods over delay: scores, benchmark, tables and pictures of bilateral simulations."""
