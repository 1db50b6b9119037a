"""Light of lamps, shop fronts and headlights on what is around them."""
