"""Physical world of a quadrotor: rigid body, motors, drag, wind, and the fast loop that tracks the plan."""
