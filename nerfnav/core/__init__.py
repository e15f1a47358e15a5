"""Core: errors, tensor records, compilation, caches, files and memory, which every other package builds on."""
