"""Core-seconds and memory of parts, from several scripts: a line each."""

from .markdown import table

# What is measured, and how a figure says it.
ITERATION = [
    (
        "one iteration, five levels, interior scene, 1280x720, 100,000 light paths",
        lambda v: f"{v['all']:.2f} core-seconds (light {v['light']:.2f}, map {v['map']:.2f}, eye {v['eye']:.2f})",
    ),
    ("the pilot before its first iteration", lambda v: f"{v['pilot']:.2f} core-seconds"),
    ("layers and combiner after its last iteration", lambda v: f"{v['combiner']:.2f} core-seconds"),
    ("peak memory of this render", lambda v: f"{v['peak_gib']:.2f} GiB"),
    (
        "an iteration with five levels against one with one level, both with two eye paths",
        lambda v: f"{100 * (v['all'] / v['one_level_two_paths'] - 1):+.1f} %",
    ),
    (
        "an iteration with five levels against one with one level on one eye path",
        lambda v: f"{100 * (v['all'] / v['one_level_one_path'] - 1):+.0f} %",
    ),
]
SPINE = [
    (
        "rays with their surfaces against bare Embree, one thread",
        lambda v: (
            f"{v['rays_m_per_s']:.2f} against {v['embree_m_per_s']:.2f} M/s ({v['rays_percent_of_embree']:.0f} %)"
        ),
    ),
    ("photon map of 200,000 photons, one thread", lambda v: f"{v['map_ms']:.1f} ms"),
]
METHODS = [
    (
        "VCM, one light and one eye path per pixel, 512x512 Cornell box with a mirror sphere",
        lambda v: f"{v['vcm_512']:.2f} core-seconds an iteration",
    ),
    ("photons that VCM keeps from the iteration before, same picture", lambda v: f"{v['vcm_photons_mib']:.0f} MiB"),
    ("the same as whole light vertices, by arithmetic", lambda v: f"{v['vcm_vertices_mib']:.0f} MiB"),
    (
        "path tracing, diffuse Cornell box",
        lambda v: f"{v['path_diffuse_million_per_core_s']:.2f} million paths per core-second",
    ),
]
# Figure, the script that measures it, and what it says.
PARTS = [("interior-iteration", "iteration", ITERATION), ("spine", "spine", SPINE), ("methods", "methods", METHODS)]


def speed(figures):
    """What parts of the program take, by script."""
    rows = []
    for name, script, lines in PARTS:
        values = figures.one(name)
        rows += [[what, told(values), f"`scripts/lab.sh {script}`"] for what, told in lines]
    return table(["what", "measured", "command"], rows)


def queries(figures):
    """Microseconds of a range query, by how photons lie and by structure."""
    rows = []
    for one in figures.all("photon-structure"):
        times = [f"{one[key]:.3g}" for key in ("tree_us", "grid_us", "kd_us")]
        rows.append([one["scene"], f"{one['spread']:,}-fold", *times])
    return table(["photons", "radii spread", "tree, us", "hash grid, us", "kd-tree, us"], rows)


KINDS = {"speed": speed, "photon-structure": queries}
