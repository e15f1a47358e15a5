"""Export stored plans and flights, occupancy maps and surfaces for other programs."""
