"""The experiments of the three papers, side by side with what they printed."""
