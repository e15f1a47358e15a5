"""Free space: scales, border of the field, occupancy maps, A*, regions, and ends at which a body fits."""
