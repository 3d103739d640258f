"""Bounding volume hierarchies with eight children a node: how they are built, walked, and filled with triangles.

Machinery below shapes, because a mesh is a shape with a tree inside; the accelerator over a scene's items is above them.
"""
