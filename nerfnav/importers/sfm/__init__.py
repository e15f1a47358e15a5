"""Structure from motion: poses, points and lens from the pictures of one camera alone."""
