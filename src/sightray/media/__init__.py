"""Participating media: fog, smoke, milk, marble, and clear stained glass."""
