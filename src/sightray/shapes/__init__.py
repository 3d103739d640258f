"""Shapes: surfaces that rays meet. `shapes.base` states what each one promises."""
