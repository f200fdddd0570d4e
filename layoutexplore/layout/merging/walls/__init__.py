"""Where the walls of a map are, and what of its obstacles is none."""
