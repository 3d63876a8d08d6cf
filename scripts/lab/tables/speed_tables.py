"""Tables of the speed of parts."""

from .markdown import table

# The title of each row, and a function that gives its text from the values of a figure.
ITERATION = [
    (
        "one iteration, five levels, interior scene, 1280x720, 100,000 light paths",
        lambda v: (
            f"{v['all']:.2f} core-seconds (light paths {v['light']:.2f}, photon map {v['map']:.2f}, "
            f"camera paths {v['eye']:.2f})"
        ),
    ),
    ("the pilot before its first iteration", lambda v: f"{v['pilot']:.2f} core-seconds"),
    ("layers and network after its last iteration", lambda v: f"{v['combiner']:.2f} core-seconds"),
    ("peak memory of this render", lambda v: f"{v['peak_gib']:.2f} GiB"),
    (
        "an iteration with five levels against one with one level, both with two camera paths",
        lambda v: f"{100 * (v['all'] / v['one_level_two_paths'] - 1):+.1f} %",
    ),
    (
        "an iteration with five levels and two camera paths against one with one level and one camera path",
        lambda v: f"{100 * (v['all'] / v['one_level_one_path'] - 1):+.0f} %",
    ),
]
SPINE = [
    (
        "rays with surface points against Embree alone, one thread",
        lambda v: (
            f"{v['rays_m_per_s']:.2f} against {v['embree_m_per_s']:.2f} M/s ({v['rays_percent_of_embree']:.0f} %)"
        ),
    ),
    ("photon map of 200,000 photons, one thread", lambda v: f"{v['map_ms']:.1f} ms"),
]
METHODS = [
    (
        "VCM, one light path and one camera path per pixel, 512x512 Cornell box with a mirror sphere",
        lambda v: f"{v['vcm_512']:.2f} core-seconds an iteration",
    ),
    (
        "photons that VCM keeps from the previous iteration, for this picture",
        lambda v: f"{v['vcm_photons_mib']:.0f} MiB",
    ),
    ("memory of whole light vertices instead (computed)", lambda v: f"{v['vcm_vertices_mib']:.0f} MiB"),
    (
        "path tracing, diffuse Cornell box",
        lambda v: f"{v['path_diffuse_million_per_core_s']:.2f} million paths per core-second",
    ),
]
# The name of a figure, the script that measures it, and its rows.
PARTS = [("interior-iteration", "iteration", ITERATION), ("spine", "spine", SPINE), ("methods", "methods", METHODS)]


def speed(figures):
    """Core-seconds and memory of parts of a render, by script."""
    rows = []
    for name, script, lines in PARTS:
        values = figures.one(name)
        rows += [[title, text(values), f"`scripts/lab.sh {script}`"] for title, text in lines]
    return table(["part", "measured", "command"], rows)


def queries(figures):
    """Microseconds of a range query, by distribution of photons and by data structure."""
    rows = []
    for one in figures.all("photon-structure"):
        times = [f"{one[key]:.3g}" for key in ("tree_us", "grid_us", "kd_us")]
        rows.append([one["scene"], f"{one['spread']:,}-fold", *times])
    return table(["photons", "range of bandwidths", "tree, us", "hash grid, us", "kd-tree, us"], rows)


KINDS = {"speed": speed, "photon-structure": queries}
