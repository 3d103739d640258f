"""Scenes: objects, their compilation into tables, and the rays that are shot at them."""
