"""What is shown in the scene. A layer owns its nodes, adds them once, and shows a session by changing them."""
