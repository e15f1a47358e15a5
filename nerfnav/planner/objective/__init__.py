"""Planning problem: first guesses, compiled objective with gradient, safety of a plan, default ends."""
