"""Samplers: where in the unit cubes of choices a pixel's samples fall."""
