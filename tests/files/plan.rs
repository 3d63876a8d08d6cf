//! Plans of scenes: effects of a scene, switching them off, and warnings about likely mistakes.

use crate::support;

mod advice;
mod presence;
mod switch;

use caustique::math::{DVec3, Vec3};
use caustique::path_class::Switches;
use caustique::plan::switch::Removed;
use caustique::plan::{Plan, PlanRequest, Search};
use caustique::scene::Description;
use support::scenes::{add, build, look_at, matte, quad, square};

/// A grey floor, and a camera that looks at it from above.
fn floor() -> Description {
    let mut description = Description::default();
    let plane = quad(Vec3::new(-4.0, 0.0, -4.0), Vec3::new(0.0, 0.0, 8.0), Vec3::new(8.0, 0.0, 0.0));
    add(&mut description, "Floor", plane, matte(0.5, 0.0));
    description.cameras = vec![look_at(DVec3::new(0.0, 5.0, 6.0), DVec3::ZERO, 50.0)];
    description
}

/// The plan of a scene for a kind of method.
fn plan_by(description: Description, search: Search) -> Plan {
    plan_to(description, search, None)
}

/// The plan of a scene for a kind of method, with a limit on path length.
fn plan_to(description: Description, search: Search, max_depth: Option<u32>) -> Plan {
    let scene = build(description);
    let camera = scene.camera(&square(64)).expect("there is a camera");
    let removed = Removed::default();
    let asked =
        PlanRequest { method: "any", because: "", search, max_depth, switches: Switches::default(), removed: &removed };
    let mut plan = Plan::new(&scene, &camera, &asked);
    caustique::advice::add(&mut plan, &scene, &camera, &asked);
    plan
}

fn plan(description: Description) -> Plan {
    plan_by(description, Search::Photons)
}
