"""The lidar, and what its scans do to a grid."""
