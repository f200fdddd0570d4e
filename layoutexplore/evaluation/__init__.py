"""Measuring the layout methods against ground truth."""
