"""Jobs: what the command line and the browser do, as generators of events. One file for each kind of job."""
