"""Plans among obstacles whose motion is known: search in time, spline within limits, replanning."""
