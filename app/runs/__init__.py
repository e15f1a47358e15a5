"""The shelf of flights: written step by step as they are flown, listed, opened, compared, renamed, deleted."""
