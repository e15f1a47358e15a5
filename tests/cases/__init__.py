"""Small inputs of public bug reports, run by the commands that their readers would type."""
