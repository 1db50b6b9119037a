"""Facts of a place that several stages need, decided once: tags, outlines, levels, kinds of ground, sight."""
