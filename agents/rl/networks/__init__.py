"""Networks that score frontiers: how they read an observation, how frontiers see each other, actor and critic."""
