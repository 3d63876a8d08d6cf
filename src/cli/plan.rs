//! `caustique plan`: prints which effects a render would simulate and why, with its warnings.

use super::progress::{Form, duration, percent};
use super::warnings::lines;
use super::{print, print_json, printable, scene};
use caustique::argument::threads;
use caustique::choose::MAX_PILOT_TIME_SHARE;
use caustique::error::Result;
use caustique::options::{RenderOptions, SceneOptions};
use caustique::pipeline::plan::{PlannedPicture, plan_picture};
use caustique::pipeline::{Forecast, Loaded, forecast};
use caustique::plan::{EffectPlan, Plan};
use caustique::render::CONFIDENCE;
use caustique::stop::Stop;
use serde_json::json;

/// Show which effects a scene calls for, which will be simulated, and why.
///
/// Reads the scene as 'caustique render' does, compares methods as --method auto does, and prints the plan. Warns of
/// likely mistakes in the scene: glass that does not refract, enclosed lamps, lamps that are a thousand times too
/// bright, and the like.
#[derive(clap::Args)]
#[command(next_line_help = true)]
pub struct PlanArgs {
    #[command(flatten)]
    options: RenderOptions,

    /// Threads; 0 takes all cores
    #[arg(long, value_name = "T", default_value_t = 0, value_parser = threads, help_heading = "Running")]
    threads: usize,
    /// Print one JSON object
    #[arg(long, help_heading = "Running")]
    json: bool,
}

impl PlanArgs {
    /// The options about the scene and how it is read.
    pub fn scene(&self) -> &SceneOptions {
        &self.options.scene
    }
}

/// Prints the plan of a render: its effects and why they are simulated.
pub fn run(args: &PlanArgs) -> Result<()> {
    super::pool(args.threads)?.install(|| report(args))
}

fn report(args: &PlanArgs) -> Result<()> {
    let (options, form) = (&args.options, Form::for_output(args.json));
    let mut request = options.picture_request()?;
    request.settings.threads = args.threads;
    let loaded = scene::read(&options.scene, form, rayon::current_num_threads())?;
    let auto = request.settings.method.0.is_none();
    let doing = if auto { "choosing a method" } else { "planning" };
    let planned = form.during(doing, || plan_picture(&request, &options.scene.path, &loaded, &Stop::default()))?;
    let forecast =
        options.settings.target_error.map(|target| Ok((target, forecast_error(args, &loaded, &planned, target)?)));
    let forecast = forecast.transpose()?;
    let plan = &planned.plan;
    if args.json {
        let mut object = json!(plan);
        if let Some((_, forecast)) = forecast {
            object["outlook"] = json!(forecast);
        }
        print_json(&object)?
    } else {
        let mut text = text(plan, options.scene.verbose);
        if let Some((error, forecast)) = forecast {
            text += &sentence(error, forecast, &planned);
        }
        if auto && plan.effects.iter().all(|effect| effect.energy.is_none()) {
            text += &advise_measurement(options, &planned);
        }
        print(&text)?
    }
    let warnings = &loaded.scene.warnings;
    if options.scene.strict && !warnings.is_empty() {
        return Err(scene::strict_error(&options.scene, warnings.len()));
    }
    Ok(())
}

/// Forecasts the cost of rendering to the relative error `target`; `None` if it cannot be known.
fn forecast_error(args: &PlanArgs, loaded: &Loaded, planned: &PlannedPicture, target: f64) -> Result<Option<Forecast>> {
    let view = planned.view(loaded);
    let settings =
        planned.chosen.settings.clone().with_light_paths(args.options.settings.photons, view.camera.whole()[0]);
    let mut finish = args.options.forecast_finish()?;
    let choice = planned.chosen.spent();
    let work = || forecast(view, &settings, &mut finish, target, choice);
    Form::for_output(args.json).during("trying how the error falls", work)
}

/// The forecast as a sentence: `error 2.0 % after about 3 min 20 s (0.11 core-hours, 400 iterations)`, the render that it
/// assumes, and the pilot that it follows from.
fn sentence(error: f64, forecast: Option<Forecast>, planned: &PlannedPicture) -> String {
    let Some(forecast) = forecast else {
        return format!("error {}: a pilot tells no time after which it is reached\n", percent(error));
    };
    let Forecast {
        iterations, iterations_interval: [low, high], seconds, core_seconds, pilot: (done, reached), ..
    } = forecast;
    let cost = match core_seconds {
        short if short < MIN_CORE_HOURS * 3600.0 => format!("{short:.1} core-seconds"),
        long => format!("{:.2} core-hours", long / 3600.0),
    };
    let ((width, height), chosen) = (planned.camera.size(), &planned.chosen);
    let method = chosen.candidate.map_or_else(|| chosen.settings.method.name().into(), |candidate| candidate.name());
    format!(
        "error {} after about {} ({cost}, {iterations} iterations; {} of renders need {low} to {high}) of a \
         finished render of {width} x {height} pixels by {method}, without --iterations and --time: a \
         small pilot had {} after {done}\n",
        percent(error),
        duration(seconds),
        percent(CONFIDENCE),
        percent(reached),
    )
}

/// How to get the figures that a plan of a short render lacks, and how long that takes.
fn advise_measurement(options: &RenderOptions, planned: &PlannedPicture) -> String {
    let Some(choice) = &planned.chosen.choice else {
        return "nothing is measured: the options leave one method (leave out those about the method)\n".into();
    };
    // A margin, because costs are predicted; a pilot that has run out of its time needs a longer limit than the given one.
    let least = (1.2 * choice.seconds_to_measure).max(2.0 * options.settings.time.unwrap_or(0.0)).ceil();
    let without = if options.settings.iterations.is_some() { " and without --iterations" } else { "" };
    format!(
        "nothing is measured, because the render is too short: plan with --time {least}{without}, which takes about {}\n",
        duration(MAX_PILOT_TIME_SHARE * least)
    )
}

/// Core-hours below which a cost is given in core-seconds.
const MIN_CORE_HOURS: f64 = 0.1;

/// A column of the plan's table: its title, and its text for an effect.
type Column = (&'static str, fn(&EffectPlan) -> String);

fn figure(x: Option<f64>, say: fn(f64) -> String) -> String {
    x.map_or("-".into(), say)
}

/// The columns of the plan's table before the reasons. Columns of figures exist if a pilot has estimated some.
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

/// The plan as text: a table of effects for people.
fn text(plan: &Plan, verbose: bool) -> String {
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
    for warning in lines(&plan.warnings, verbose) {
        text += &format!("warning: {}\n", printable(&warning));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use caustique::path_class::{Effect, Switches};
    use caustique::pipeline::choose::Chosen;
    use caustique::pipeline::plan::{self, PlanInput};
    use caustique::plan::switch::Removed;
    use caustique::render::{Candidate, Method, Settings};
    use caustique::scene::{CameraRequest, Description, Scene, View};

    /// A column of figures exists if an effect has one, with dashes for the other effects.
    #[test]
    fn figures_have_columns() {
        let scene = Scene::build(Description::default(), 1).unwrap();
        let camera = scene.camera(&CameraRequest::default()).unwrap();
        let chosen = Chosen::named(Settings::for_candidate(Candidate::unguided(Method::Vcm)));
        let input = PlanInput { chosen: &chosen, max_depth: None, switches: Switches::default() };
        let mut plan = plan::plan(input, View::new(&scene, &camera), &Removed::default());
        assert_eq!(columns(&plan).len(), 2);
        let caustic = &mut plan.effects[Effect::Caustic as usize];
        (caustic.energy, caustic.seconds_per_iteration, caustic.error_if_off) = (Some(0.123), Some(0.25), Some(0.4));
        let text = text(&plan, false);
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
