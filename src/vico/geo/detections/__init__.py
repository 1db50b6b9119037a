"""Things that a detector found in street photos, or that somebody else located: COCO and GeoJSON files."""
