//! `caustique plan`: what a render of a scene would simulate, why, and what it warns of.

use super::progress::{Form, duration, percent};
use super::{print, print_json, printable, scene};
use caustique::choose::choose;
use caustique::error::Result;
use caustique::options::number::threads;
use caustique::options::{RenderOptions, SceneOptions};
use caustique::pipeline::{Loaded, Outlook, check, outlook, plan, sized};
use caustique::plan::{EffectPlan, Plan};
use caustique::scene::View;
use serde_json::json;

/// Say which effects a scene calls for, which will be simulated, and why.
///
/// Reads the scene as 'caustique render' does, tries what --method auto tries, and prints what it would do. Below that
/// it says what looks like a mistake in the scene: glass that does not bend light, lamps that are closed in or a
/// thousand times too bright, and the like.
#[derive(clap::Args)]
#[command(next_line_help = true)]
pub struct PlanArgs {
    #[command(flatten)]
    job: RenderOptions,

    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    threads: usize,
    /// Print one JSON object
    #[arg(long, help_heading = "Running")]
    json: bool,
}

impl PlanArgs {
    /// The scene that is looked at.
    pub fn scene(&self) -> &SceneOptions {
        &self.job.scene
    }
}

/// Plans without rendering.
pub fn run(args: &PlanArgs) -> Result<()> {
    super::pool(args.threads)?.install(|| report(args))
}

fn report(args: &PlanArgs) -> Result<()> {
    let job = &args.job;
    // Options that contradict each other are errors here, too.
    let settings = job.settings()?;
    let Loaded { scene, removed } = scene::read(&job.scene, Form::beside(args.json), rayon::current_num_threads())?;
    let camera = scene.camera(&job.camera_request()?)?;
    let view = View::new(&scene, &camera);
    check::media(&job.scene.path, &settings, &scene)?;
    let make = |candidate| job.candidate_settings(candidate, camera.size());
    let choice = if job.method.0.is_none() {
        let mut finish = job.pilot_finish();
        let tried = || choose(view, &mut finish, make, || false);
        Form::beside(args.json).during("choosing a method", tried)
    } else {
        None
    };
    let asked = plan::Asked { choice: choice.as_ref(), max_depth: job.max_depth, switches: job.scene.switches() };
    let mut plan = plan::plan(&asked, settings.method, view, &removed);
    let of_scene = &scene.warnings;
    plan.warnings.splice(0..0, of_scene.iter().cloned());
    let outlook = match job.target_error {
        Some(error) => {
            let settings = choice.as_ref().map_or(&settings, |choice| &choice.settings);
            let settings = sized(settings.clone(), job.photons, camera.size());
            let mut finish = job.outlook_finish()?;
            let tried = || outlook(view, &settings, &mut finish, error);
            Some((error, Form::beside(args.json).during("trying how the error falls", tried)?))
        }
        None => None,
    };
    if args.json {
        let mut object = json!(plan);
        if let Some((_, outlook)) = outlook {
            object["outlook"] = json!(outlook);
        }
        print_json(&object)?
    } else {
        let mut text = text(&plan);
        if let Some((error, outlook)) = outlook {
            text += &foretold(error, outlook);
        }
        if job.method.0.is_none() && plan.effects.iter().all(|effect| effect.energy.is_none()) {
            text += "nothing is measured: a pilot needs a longer render (--time, --iterations) or a larger picture\n";
        }
        print(&text)?
    }
    if job.scene.strict && !of_scene.is_empty() {
        return Err(scene::forbidden(&job.scene, of_scene.len()));
    }
    Ok(())
}

/// `error 2.0 % after about 3 min 20 s (0.11 core-hours, 400 iterations)`, and by what that is told.
fn foretold(error: f64, outlook: Option<Outlook>) -> String {
    let Some(Outlook { iterations, seconds, core_seconds, pilot: (done, reached), .. }) = outlook else {
        return format!("error {}: a pilot tells no time after which it is reached\n", percent(error));
    };
    format!(
        "error {} after about {} ({:.2} core-hours, {iterations} iterations): a small pilot had {} after {done}\n",
        percent(error),
        duration(seconds),
        core_seconds / 3600.0,
        percent(reached),
    )
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
    let mut rows = vec![(cells(&|column| column.0.into()), vec!["because".to_string()])];
    for effect in &plan.effects {
        let because: Vec<String> = match &effect.because[..] {
            [] => vec!["nothing in the scene calls for it".into()],
            because => because.iter().map(|reason| printable(reason)).collect(),
        };
        rows.push((cells(&|column| (column.1)(effect)), because));
    }
    let width = |column: usize| rows.iter().map(|(cells, _)| cells[column].chars().count()).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns.len()).map(width).collect();
    let indent = 2 + widths.iter().map(|width| width + 2).sum::<usize>();
    let mut text = format!("{}: {}, {}\n", printable(&plan.scene), plan.method, printable(&plan.because));
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
        text += &format!("warning: {}\n", printable(warning));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use caustique::plan::switch::Removed;
    use caustique::plan::{Effect, Switches};
    use caustique::render;
    use caustique::scene::{CameraRequest, Description, Scene};

    /// Columns of figures are there when something has measured them, with a dash where it has not.
    #[test]
    fn figures_have_columns() {
        let scene = Scene::build(Description::default(), 1).unwrap();
        let camera = scene.camera(&CameraRequest::default()).unwrap();
        let asked = plan::Asked { choice: None, max_depth: None, switches: Switches::default() };
        let mut plan = plan::plan(&asked, render::Method::Vcm, View::new(&scene, &camera), &Removed::default());
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
