"""Shading of pixels: texture, sun, sky light, lamps, haze; and the sky itself."""
