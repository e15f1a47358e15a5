"""What nerfnav is faster at than the paper's way: both timed in one run, on one machine, with one result."""
