//! Scenes as USD stages, reduced to features that both USD and glTF have.

use super::world::{Lens, Light, LightKind, Matter, Mesh, Placement, Thing, ThingKind, World};
use caustique::scene::Description;
use caustique::scene::gltf::ReadOptions;
use caustique::stop::Stop;
use glam::DVec3;

/// The part of a scene that USD can express: no media, textures, lenses, panoramas, soft spots and spots with a radius, and no
/// partial specular reflection.
pub fn reduced(world: &World) -> World {
    let mut made = World { fog: None, textures: vec![], ..world.clone() };
    for matter in &mut made.materials {
        let specular = if matter.specular > 0.0 { 1.0 } else { 0.0 };
        let ior = if matter.is_glass() { matter.ior } else { 1.5 };
        *matter = Matter {
            medium: None,
            fire: None,
            alpha: 1.0,
            texture: None,
            bumps: None,
            priority: 0,
            specular,
            ior,
            ..matter.clone()
        };
    }
    for thing in &mut made.things {
        thing.hidden = false;
        thing.unlit.clear();
        thing.unblocked.clear();
        match &mut thing.kind {
            ThingKind::Mesh { .. } => continue,
            ThingKind::Camera(lens) => (lens.aperture, lens.panorama) = (0.0, None),
            ThingKind::Light(Light { kind: LightKind::Spot { inner, outer, radius }, .. }) => {
                (*inner, *radius) = (*outer, 0.0);
            }
            ThingKind::Light(_) => {}
        }
        // Sizes of lights and cameras are in world space in glTF, and in the space of their node in USD.
        let (_, rotation, translation) = thing.to_world().to_scale_rotation_translation();
        thing.chain = vec![Placement { translation, rotation, scale: DVec3::ONE }];
    }
    made
}

/// Name of a camera after its stage is read.
pub fn camera(name: &str) -> String {
    format!("/{}", name.replace(' ', "_"))
}

/// Reads a scene as a USD stage.
///
/// # Errors
/// The reader refuses the file.
pub fn read(world: &World) -> Result<Description, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let path = folder.path().join("random.usda");
    std::fs::write(&path, stage(world)).map_err(|error| error.to_string())?;
    caustique::scene::usd::read(&path, &ReadOptions::default(), 0.0, &Stop::default())
        .map_err(|error| error.to_string())
}

/// The stage as text.
pub fn stage(world: &World) -> String {
    let mut text = String::from("#usda 1.0\n(\n    metersPerUnit = 1\n    upAxis = \"Y\"\n)\n");
    text += "def Scope \"Materials\"\n{\n";
    for (index, matter) in world.materials.iter().enumerate() {
        text += &material(index, matter);
    }
    text += "}\n";
    for thing in &world.things {
        let mut chain = thing.chain.clone();
        let own = chain.pop().unwrap_or(Placement::IDENTITY);
        for (depth, placement) in chain.iter().enumerate() {
            text += &format!("def Xform \"{}\"\n{{\n{}", level(thing, depth), transform(placement));
        }
        let (kind, body) = match &thing.kind {
            ThingKind::Mesh { mesh, material } => ("Mesh", geometry(&world.meshes[*mesh], *material)),
            ThingKind::Light(light) => light_of(light),
            ThingKind::Camera(lens) => ("Camera", camera_of(lens)),
        };
        let schemas = match kind {
            "Mesh" => "MaterialBindingAPI",
            "SphereLight" => "ShapingAPI",
            _ => "",
        };
        let schemas = if schemas.is_empty() { "".into() } else { format!("(prepend apiSchemas = [\"{schemas}\"])\n") };
        let name = level(thing, chain.len());
        text += &format!("def {kind} \"{name}\" {schemas}{{\n{body}{}}}\n", transform(&own));
        text += &"}\n".repeat(chain.len());
    }
    if let Some(sky) = world.sky {
        text += &format!("def DomeLight \"sky\"\n{{\ncolor3f inputs:color = {}\n}}\n", tuple(sky));
    }
    text
}

/// Name of the prim of a thing, or of one of its ancestors. The outermost prim has the name of the thing.
fn level(thing: &Thing, depth: usize) -> String {
    if depth == 0 { thing.name.replace(' ', "_") } else { format!("level_{depth}") }
}

/// Three numbers.
fn tuple(v: DVec3) -> String {
    format!("({:?}, {:?}, {:?})", v.x, v.y, v.z)
}

fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(", "))
}

/// As USD writes it, for row vectors.
fn transform(placement: &Placement) -> String {
    let to_parent = placement.affine();
    let rows: [(DVec3, f64); 4] = [
        (to_parent.matrix3.x_axis, 0.0),
        (to_parent.matrix3.y_axis, 0.0),
        (to_parent.matrix3.z_axis, 0.0),
        (to_parent.translation, 1.0),
    ];
    let rows = rows.map(|(v, w)| format!("({:?}, {:?}, {:?}, {w:?})", v.x, v.y, v.z)).join(", ");
    format!("matrix4d xformOp:transform = ({rows})\nuniform token[] xformOpOrder = [\"xformOp:transform\"]\n")
}

fn geometry(mesh: &Mesh, material: usize) -> String {
    let vectors = |all: &[DVec3]| list(all.iter().map(|p| tuple(p.as_vec3().as_dvec3())));
    let counts = list(mesh.triangles.iter().map(|_| "3".into()));
    let corners = list(mesh.triangles.iter().flatten().map(u32::to_string));
    let mut text = format!(
        "uniform token subdivisionScheme = \"none\"\nbool doubleSided = 1\nint[] faceVertexCounts = {counts}\nint[] faceVertexIndices = {corners}\npoint3f[] points = {}\nrel material:binding = </Materials/m{material}>\n",
        vectors(&mesh.positions)
    );
    if !mesh.normals.is_empty() {
        text += &format!("normal3f[] normals = {} (interpolation = \"vertex\")\n", vectors(&mesh.normals));
    }
    text
}

/// Intensities of lamps are a quarter of the emission of the sphere's surface.
fn light_of(light: &Light) -> (&'static str, String) {
    let color = light.color;
    let lamp = |radius: f64, cone: &str| {
        let emitted = tuple(4.0 * color);
        format!(
            "color3f inputs:color = {emitted}\nfloat inputs:radius = {radius:?}\nbool inputs:normalize = 1\nbool treatAsPoint = {}\n{cone}",
            u8::from(radius == 0.0)
        )
    };
    match light.kind {
        LightKind::Point { radius } => ("SphereLight", lamp(radius, "float inputs:shaping:cone:angle = 180\n")),
        LightKind::Spot { outer, radius, .. } => {
            ("SphereLight", lamp(radius, &format!("float inputs:shaping:cone:angle = {:?}\n", outer.to_degrees())))
        }
        LightKind::Sun { angle } => (
            "DistantLight",
            format!(
                "color3f inputs:color = {}\nfloat inputs:intensity = 1\nfloat inputs:angle = {angle:?}\nbool inputs:normalize = 1\n",
                tuple(color)
            ),
        ),
    }
}

/// Apertures and focal lengths are in tenths of the scene unit.
fn camera_of(lens: &Lens) -> String {
    let (projection, aperture) = if lens.orthographic {
        ("orthographic", 20.0 * lens.view)
    } else {
        ("perspective", 100.0 * (0.5 * lens.view).tan())
    };
    format!(
        "token projection = \"{projection}\"\nfloat focalLength = 50\nfloat horizontalAperture = {aperture:?}\nfloat verticalAperture = {aperture:?}\n"
    )
}

/// Materials without specular reflection use the specular workflow, all others the metallic one.
fn material(index: usize, matter: &Matter) -> String {
    let opacity = if matter.is_glass() { 0.0 } else { 1.0 };
    format!(
        "def Material \"m{index}\"\n{{\ntoken outputs:surface.connect = </Materials/m{index}/surface.outputs:surface>\ndef Shader \"surface\"\n{{\nuniform token info:id = \"UsdPreviewSurface\"\nint inputs:useSpecularWorkflow = {}\ncolor3f inputs:specularColor = (0, 0, 0)\ncolor3f inputs:diffuseColor = {}\ncolor3f inputs:emissiveColor = {}\nfloat inputs:metallic = {:?}\nfloat inputs:roughness = {:?}\nfloat inputs:ior = {:?}\nfloat inputs:opacity = {opacity:?}\nfloat inputs:clearcoat = {:?}\nfloat inputs:clearcoatRoughness = 0\ntoken outputs:surface\n}}\n}}\n",
        u8::from(matter.specular == 0.0),
        tuple(matter.base),
        tuple(matter.emission),
        matter.metallic,
        matter.roughness,
        matter.ior,
        matter.clearcoat,
    )
}
