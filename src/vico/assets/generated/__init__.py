"""Models of things out of words: a picture of them, a mesh of the picture, and what fits into a world of the mesh."""
