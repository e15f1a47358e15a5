"""Fuzz: damaged inputs of each kind through the command's own entry; none may end in anything but one sentence."""
