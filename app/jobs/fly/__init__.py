"""Fly in a simulated world: the request, the set-up, the flight and its report."""
