"""Where tracked pictures come from, one file for each kind."""
