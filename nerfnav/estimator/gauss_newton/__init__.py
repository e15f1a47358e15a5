"""Gauss-Newton filters: the fast filter, the filter of real pictures, and their posteriors."""
