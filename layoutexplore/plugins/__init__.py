"""What is chosen by name (agents, predictors, layout methods), and users' own code beside what ships."""
