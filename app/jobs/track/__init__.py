"""Localize pictures and track cameras in a field."""
