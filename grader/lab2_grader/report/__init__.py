"""Pure renderers of what was found, for people and for other programs."""
