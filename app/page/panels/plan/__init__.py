"""Planning panels: robot, start and goal, plan, and the occupancy map that planners use."""
