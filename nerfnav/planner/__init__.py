"""Planning: from a start and a goal to a trajectory through low density."""
