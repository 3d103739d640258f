"""All that kernels are written in, for members in your own files; docs/extending.md shows how.

``from sightray.kernels import *`` gives the decorators, the types of annotations, vectors, table accessors, random
numbers, and the laws of reflection and refraction.
"""

from sightray._jit import implements, kernel
from sightray.mathlib.frame import fresnel, perpendicular, reflect, refract
from sightray.mathlib.rng import stream, uniform
from sightray.mathlib.scalars import f32, f64, i32, i64
from sightray.mathlib.table import Table, f32_at, f64_at, i32_at, i64_at, table_at, vec3_at
from sightray.mathlib.vec import Vec3, cross, dot, grey, length, max3, normalize, vabs, vexp, vmax, vmin

__all__ = [
    "Table", "Vec3", "cross", "dot", "f32", "f32_at", "f64", "f64_at", "fresnel", "grey", "i32", "i32_at", "i64",
    "i64_at", "implements", "kernel", "length", "max3", "normalize", "perpendicular", "reflect", "refract", "stream",
    "table_at", "uniform", "vabs", "vec3_at", "vexp", "vmax", "vmin",
]  # fmt: skip
