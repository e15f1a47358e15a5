"""The command line and the browser app: both run the same jobs."""
