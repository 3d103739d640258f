"""The ground floor: numbers, vectors, tables and random streams that kernels are written in."""
