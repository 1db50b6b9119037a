"""Which colour a pixel gets: texture, sun, sky light, lamps, haze; and the sky itself."""
