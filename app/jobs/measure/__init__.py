"""Measure: experiments, and the bench against the paper's method."""
