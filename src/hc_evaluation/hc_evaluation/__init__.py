"""Metrics, bounds, benchmarks and the papers' experiments."""
