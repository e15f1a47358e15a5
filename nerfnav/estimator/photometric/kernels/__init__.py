"""Compiled parts of the photometric term and of its minimisation."""
