"""Accelerators: structures that find what a ray meets. `accelerators.base` states what each one promises."""
