"""Place panels: the open place, the library of places, alignment, view settings."""
