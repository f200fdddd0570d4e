"""Networks that score frontiers: reading an observation, encoders of sets of frontiers, actor and critic."""
