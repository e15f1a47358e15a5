"""Subcommands of `nerfnav`: one file each, with `Arguments` and `run`, registered in app/cli/main.py."""
