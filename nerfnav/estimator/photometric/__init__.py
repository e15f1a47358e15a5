"""Photometric term: compare pixels of a picture with the field, and minimise the difference over camera poses."""
