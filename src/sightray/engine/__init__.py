"""The engine: how any integrator is run over all pixels, in tiles, on all cores."""
