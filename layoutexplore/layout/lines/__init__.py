"""Layouts from wall lines: ROSE (ICRA 2021), ROSE2 (arXiv 2203.03519) and IAS-15."""
