"""Sightray: a fast, readable ray tracer for Python."""
