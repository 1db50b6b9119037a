"""Streets of the map and the road network made of them."""
