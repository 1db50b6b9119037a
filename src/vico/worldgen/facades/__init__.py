"""Looks of walls: facades by use, age and height, doors, windows, signs, and the textures of all grounds."""
