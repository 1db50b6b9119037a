"""3D Tiles: tilesets read into one textured mesh in the local frame."""
