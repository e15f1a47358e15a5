"""Taking plans and episodes away: to files, robots and viewers."""
