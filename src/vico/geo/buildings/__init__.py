"""Buildings that others than OpenStreetMap know: city models (CityJSON, CityGML) and Overture's footprints."""
