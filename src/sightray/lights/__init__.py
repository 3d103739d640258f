"""Lights. `lights.base` states what each one promises."""
