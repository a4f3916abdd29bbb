"""The live panel of a terminal: numbers as text, sparklines, layout at any width.

Modules: numbers (fixed decimals, engineering units), sparkline, view (what the panel shows, made
from the state of a run), panel (the picture of it), keys.
"""
