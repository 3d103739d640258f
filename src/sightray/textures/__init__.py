"""Textures: colours that vary over a surface. `textures.base` states what each one promises."""
