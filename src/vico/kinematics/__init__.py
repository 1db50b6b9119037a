"""Arms as chains of joints: where a hand is, which angles bring it somewhere, and ways there that touch nothing."""
