"""Golden files: what this program wrote and computed at one time, which later versions must read and compute alike."""
