"""Grid maps of floor plans with the noise of real ones, fitted to the statistics of maps without truth."""
