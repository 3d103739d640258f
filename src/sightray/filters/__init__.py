"""Pixel filters: how much light beside a pixel's centre counts. `filters.base` states what each one promises."""
