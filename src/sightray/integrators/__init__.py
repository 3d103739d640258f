"""Integrators: what light comes along a ray of sight. `integrators.base` states what each one promises."""
