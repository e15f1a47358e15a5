"""Free space: scales, border of the field, occupancy maps, A*, regions, ends at which a body fits, and the ground."""
