"""Tasks in the bundled places: available at once, while the places themselves take seconds to build."""
