"""Online estimators of the Hunt-Crossley contact parameters, and their node."""
