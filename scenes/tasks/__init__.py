"""What is asked of robots in the bundled places: known at once, while the places themselves take seconds to build."""
