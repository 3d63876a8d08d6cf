"""Range queries in our tree, in a hash grid and in a kd-tree, for clustered photons and widely varying bandwidths."""

from ..bench import lines
from ..record import record


def main():
    for index, line in enumerate(lines("photons")):
        print(line, flush=True)
        if index < 2:
            continue
        scene, spread, _, _, tree, grid, kd, *_ = [None, *line.split()][1:] + [None] * 0
        values = {"scene": scene, "spread": float(spread), "tree_us": float(tree)}
        record("photon-structure", values | {"grid_us": float(grid), "kd_us": float(kd)})
