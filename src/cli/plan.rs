//! `caustique plan`: what a render of a scene would simulate, why, and what it warns of.

use super::number::{positive, threads};
use super::progress::percent;
use super::render::Method;
use super::render::plan::{Wishes, check_media, plan};
use super::scene::{self, SceneArgs};
use super::{print, print_json};
use caustique::error::Result;
use caustique::plan::{EffectPlan, Plan};
use caustique::render::auto::{Free, choose};
use caustique::render::{DEFAULT_ITERATIONS, Settings};
use caustique::scene::{MAX_SIZE, View};
use clap::value_parser;
use serde_json::json;

/// Say which effects a scene calls for, which will be simulated, and why.
///
/// Reads the scene as 'caustique render' does, tries what --method auto tries, and prints what it would do. Below that it says what looks like a mistake in the scene: glass that does not bend
/// light, lamps that are closed in or a thousand times too bright, and the like.
#[derive(clap::Args)]
#[command(next_line_help = true)]
pub struct PlanArgs {
    #[command(flatten)]
    scene: SceneArgs,

    /// How light is found
    #[arg(long, value_enum, default_value_t = Method::Auto, help_heading = "Method")]
    method: Method,
    /// Longest light path in segments, camera to light; boundaries that do not bend light are not counted [default: no limit]
    #[arg(long, value_name = "N", value_parser = value_parser!(u32).range(1..=1_000_000), help_heading = "Method")]
    max_depth: Option<u32>,

    /// Width in pixels; without a height the camera's aspect is kept [default: 1280]
    #[arg(long, value_name = "W", value_parser = value_parser!(u32).range(1..=i64::from(MAX_SIZE)), help_heading = "Picture")]
    width: Option<u32>,
    /// Height in pixels; without a width the camera's aspect is kept
    #[arg(long, value_name = "H", value_parser = value_parser!(u32).range(1..=i64::from(MAX_SIZE)), help_heading = "Picture")]
    height: Option<u32>,
    /// Camera by name [default: the scene's first]
    #[arg(long, value_name = "NAME", help_heading = "Picture")]
    camera: Option<String>,

    /// Of a render of so many iterations [default: 64, if there is no time]
    #[arg(long, value_name = "N", value_parser = value_parser!(u64).range(1..=2_000_000_000), help_heading = "When to stop")]
    iterations: Option<u64>,
    /// Of a render of so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = positive, help_heading = "When to stop")]
    time: Option<f64>,

    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    threads: usize,
    /// Print one JSON object
    #[arg(long, help_heading = "Running")]
    json: bool,
}

/// Plans without rendering.
pub fn run(args: &PlanArgs) -> Result<()> {
    super::pool(args.threads)?.install(|| report(args))
}

fn report(args: &PlanArgs) -> Result<()> {
    let loaded = scene::read(&args.scene, rayon::current_num_threads())?;
    let view = View { camera: args.camera.clone(), width: args.width, height: args.height };
    let camera = loaded.scene.camera(&view)?;
    check_media(&args.scene.path, args.method, None, &loaded.scene)?;
    let free = Free { photons: false, neighbours: false };
    let max_depth = args.max_depth.unwrap_or(u32::MAX);
    let classes = args.scene.switches().classes();
    let (time, iterations) = (args.time, args.iterations.or(args.time.is_none().then_some(DEFAULT_ITERATIONS)));
    // As a render does that combines levels.
    let make = |way| {
        let usual = Settings::of(way);
        let photons = usual.usual_photons(camera.size());
        let settings = Settings { max_depth, classes, time, iterations, photons, ..usual };
        (settings.levels.count > 1).then_some(settings)
    };
    let choice =
        (args.method == Method::Auto).then(|| choose((&loaded.scene, &camera), free, make, || false)).flatten();
    let switches = args.scene.switches();
    let wishes = Wishes { method: args.method, choice: choice.as_ref(), max_depth: args.max_depth, switches };
    let mut plan = plan(&wishes, &loaded.scene, &camera, &loaded.removed);
    let of_scene = &loaded.scene.warnings;
    plan.warnings.splice(0..0, of_scene.iter().cloned());
    if args.json {
        print_json(&json!(plan))?
    } else {
        let mut text = text(&plan);
        if args.method == Method::Auto && plan.effects.iter().all(|effect| effect.energy.is_none()) {
            text += "nothing is measured: a pilot needs a longer render (--time, --iterations) or a larger picture\n";
        }
        print(&text)?
    }
    if args.scene.strict && !of_scene.is_empty() {
        return Err(scene::forbidden(&args.scene, of_scene.len()));
    }
    Ok(())
}

/// A column: its title, and what it says of an effect.
type Column = (&'static str, fn(&EffectPlan) -> String);

fn figure(x: Option<f64>, say: fn(f64) -> String) -> String {
    x.map_or("-".into(), say)
}

/// The columns before the reasons; those of figures where something has measured them.
fn columns(plan: &Plan) -> Vec<Column> {
    let mut columns: Vec<Column> = vec![("effect", |e| e.effect.name().into()), ("simulated by", carrier)];
    let any = |figure: fn(&EffectPlan) -> Option<f64>| plan.effects.iter().any(|e| figure(e).is_some());
    if any(|e| e.energy) {
        columns.push(("of the light", |e| figure(e.energy, percent)));
    }
    if any(|e| e.time) {
        columns.push(("of the time", |e| figure(e.time, percent)));
    }
    if any(|e| e.seconds_per_iteration) {
        columns.push(("off saves", |e| figure(e.seconds_per_iteration, |s| format!("{s:.2} s"))));
    }
    if any(|e| e.error_if_off) {
        columns.push(("off costs", |e| figure(e.error_if_off, |error| format!("error {}", percent(error)))));
    }
    columns
}

fn carrier(e: &EffectPlan) -> String {
    match (e.by, e.present) {
        (Some(by), _) => by.into(),
        (None, true) => "left out".into(),
        (None, false) => "-".into(),
    }
}

/// A table for people.
fn text(plan: &Plan) -> String {
    let columns = columns(plan);
    let cells = |row: &dyn Fn(&Column) -> String| columns.iter().map(row).collect::<Vec<String>>();
    let mut rows = vec![(cells(&|column| column.0.into()), vec!["because"])];
    for effect in &plan.effects {
        let because: Vec<&str> = match &effect.because[..] {
            [] => vec!["nothing in the scene calls for it"],
            because => because.iter().map(String::as_str).collect(),
        };
        rows.push((cells(&|column| (column.1)(effect)), because));
    }
    let width = |column: usize| rows.iter().map(|(cells, _)| cells[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns.len()).map(width).collect();
    let indent = 2 + widths.iter().map(|width| width + 2).sum::<usize>();
    let mut text = format!("{}: {}, {}\n", plan.scene, plan.method, plan.because);
    for (cells, because) in rows {
        text += "  ";
        for (cell, width) in cells.iter().zip(&widths) {
            text += &format!("{cell:<width$}  ");
        }
        text += &because.join(&format!("\n{:indent$}", ""));
        text.push('\n');
    }
    text += &match plan.left_out_at_most {
        Some(error) => {
            format!("nothing is left out that the scene calls for (error by it: at most {})\n", percent(error))
        }
        None => "light is left out that the scene calls for (nothing bounds the error by it)\n".into(),
    };
    for warning in &plan.warnings {
        text += &format!("warning: {warning}\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::render::plan::plan;
    use caustique::plan::switch::Removed;
    use caustique::plan::{Effect, Switches};
    use caustique::scene::{Description, Scene};

    /// Columns of figures are there when something has measured them, with a dash where it has not.
    #[test]
    fn figures_have_columns() {
        let scene = Scene::build(Description::default(), 1).unwrap();
        let camera = scene.camera(&View::default()).unwrap();
        let wishes = Wishes { method: Method::Vcm, choice: None, max_depth: None, switches: Switches::default() };
        let mut plan = plan(&wishes, &scene, &camera, &Removed::default());
        assert_eq!(columns(&plan).len(), 2);
        let caustic = &mut plan.effects[Effect::Caustic as usize];
        (caustic.energy, caustic.seconds_per_iteration, caustic.error_if_off) = (Some(0.123), Some(0.25), Some(0.4));
        let text = text(&plan);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[1], "  effect          simulated by  of the light  off saves  off costs   because");
        assert_eq!(
            lines[5],
            "  glossy          -             -             -          -           nothing in the scene calls for it"
        );
        assert_eq!(
            lines[6],
            "  caustic         -             12 %          0.25 s     error 40 %  nothing in the scene calls for it"
        );
    }
}
