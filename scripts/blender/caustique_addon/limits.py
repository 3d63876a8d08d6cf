"""Settings of Blender that a render with caustique leaves aside, each with what to do instead."""


def ignored(scene):
    """A line for each such setting that is in use in `scene`."""
    render = scene.render
    found = [
        (render.use_motion_blur, "motion blur is not rendered: add it in the compositor, or render with Cycles"),
        (render.use_multiview, "stereoscopy is not rendered, and both eyes see the same: render from two cameras"),
        (render.film_transparent, "the film is not transparent where the world is lit: key with a cryptomatte, or make "
                                  "the world black"),
        (render.pixel_aspect_x != render.pixel_aspect_y, "pixels are rendered as squares: set both pixel aspects to 1"),
        (render.use_freestyle, "Freestyle's lines are not drawn over the picture: render them with Cycles"),
    ]
    return [line for there, line in found if there]
