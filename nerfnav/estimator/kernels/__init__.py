"""Compiled parts of the estimators."""
