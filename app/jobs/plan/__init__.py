"""Plan in an open place: one plan, its report, a comparison of planners, the first plan of a process."""
