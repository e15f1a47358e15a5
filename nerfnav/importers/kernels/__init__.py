"""Compiled loops of importers."""
