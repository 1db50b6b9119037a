"""For eyes: the replay page and the demo film."""
