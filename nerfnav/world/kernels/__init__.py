"""Pictures of what rays hit, compiled; tested equal to numpy, byte by byte."""
