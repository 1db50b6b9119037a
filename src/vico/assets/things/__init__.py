"""Models of others in the place of ours: the furniture pack of Debian, found, fitted, made light and baked."""
