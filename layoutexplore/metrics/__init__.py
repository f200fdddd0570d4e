"""Scores of explorations and segmentations, and the statistics of comparisons."""
