"""What a world is: its model, its folder, and the look-ups everybody shares. No generation code."""
