"""Depth sensors: each one file, named after how it measures."""
