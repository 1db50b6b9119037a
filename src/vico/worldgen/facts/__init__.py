"""What several stages need to know of a place, decided once: tags, outlines, levels, kinds of ground, sight."""
