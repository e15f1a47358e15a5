"""Subcommands of `nerfnav`: each file has the Arguments that a user may give, and `run` that follows them."""
