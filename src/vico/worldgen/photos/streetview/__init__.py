"""Street photos on the buildings: poses mended by matching, what moves masked, the rest painted on the walls."""
