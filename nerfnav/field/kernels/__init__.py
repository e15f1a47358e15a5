"""CPU twins of the torch paths, compiled, with closed-form derivatives; each is tested equal to its reference.

All of them read one array `values` (nx, ny, nz, 4): raw density and red, green, blue of each node. Grid coordinates
g = (p - lower) / spacing. `occupied` flags blocks of 4 x 4 x 4 cells; what lies in other blocks has no density.
"""
