//! The limits that the documentation lists: what the program refuses or warns about. `tests/generated.rs` writes the lists,
//! and `tests/cli/stated_limits.rs` meets every limit and reads the message.

/// A limit of the program.
pub struct Limit {
    /// Name, by which the test of the limit finds its case.
    pub name: &'static str,
    /// The limit as the documentation describes it, in Markdown.
    pub sentence: &'static str,
    /// Part of the error or the warning for a scene or an option that meets the limit.
    pub message: &'static str,
    /// Whether the README lists it; the guide lists all.
    pub in_readme: bool,
}

/// All limits, in the order of the documentation.
pub const LIMITS: &[Limit] = &[
    Limit {
        name: "lines",
        sentence: "Points and lines, such as strands of hair, are not rendered.",
        message: ", which are not rendered",
        in_readme: true,
    },
    Limit {
        name: "media",
        sentence: "`pm` and `bpm` refuse scenes whose media scatter light.",
        message: "does not render media that scatter light",
        in_readme: true,
    },
    Limit {
        name: "catchers",
        sentence: "Only `path` renders shadow catchers, which `auto` chooses for them.",
        message: "does not render shadow catchers",
        in_readme: false,
    },
    Limit {
        name: "shadow linking",
        sentence: "Only `path` renders shadow linking, for which `auto` chooses it.",
        message: "does not render shadow linking",
        in_readme: false,
    },
    Limit {
        name: "dispersion",
        sentence: "Only solid glass disperses light.",
        message: "its dispersion is ignored: it is no solid that refracts",
        in_readme: true,
    },
    Limit {
        name: "connections",
        sentence: "`path`, `bdpt` and `light` do not find all light that mirrors and glass focus or show.",
        message: "does not find all light of the effect",
        in_readme: false,
    },
    Limit {
        name: "denoiser",
        sentence: "Without Open Image Denoise, our own denoiser finishes the picture and leaves more grain.",
        message: "our own denoiser takes its place, whose pictures are grainier",
        in_readme: true,
    },
    Limit {
        name: "extension",
        sentence: "Extensions of glTF that the [scene format](scene-format.md) does not list are ignored, or refused if the \
                   file requires them.",
        message: "is not supported and is ignored",
        in_readme: false,
    },
    Limit {
        name: "clipping",
        sentence: "Cameras do not clip: `znear` and `zfar` are ignored.",
        message: "clip planes are ignored",
        in_readme: false,
    },
    Limit {
        name: "range",
        sentence: "Light has no maximum distance: the `range` of a light is ignored.",
        message: "its range is ignored: light has no maximum distance",
        in_readme: false,
    },
];
