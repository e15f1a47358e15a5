"""Flights through corridors full of moving boxes, with planners that know the motion and planners that do not."""
