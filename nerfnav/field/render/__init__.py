"""Volume rendering: colours of rays, their derivatives by the pose, surroundings and composite fields."""
