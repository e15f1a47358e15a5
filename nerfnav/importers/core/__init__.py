"""Core of importers: kinds and magic numbers of files, errors, placement, stored pictures."""
