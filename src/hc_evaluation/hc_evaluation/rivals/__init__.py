"""The same plain unscented filter as others would write it, for hc bench speed to compare with."""
