"""Navigation: the receding-horizon loop that joins planner, simulator and filter into an episode."""
