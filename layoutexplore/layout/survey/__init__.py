"""The segmentations of the room segmentation survey (Bormann et al., ICRA 2016)."""
