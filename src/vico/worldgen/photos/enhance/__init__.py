"""What is made of an atlas once photos are on it: even light, filled holes, finer texels."""
