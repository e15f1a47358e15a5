"""Open a place: from a source to a field file to a Place, visible and with warm kernels."""
