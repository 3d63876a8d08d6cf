//! The layout of the help: the order of options, and which options `-h` leaves out.

use clap::{Arg, ArgAction, Command};

/// Headings in the help in their order. Options without a heading come first.
const HEADINGS: [&str; 12] = [
    "When to stop",
    "Runs",
    "Error",
    "Picture",
    "Output",
    "Page",
    "Method",
    "Light and glass",
    "Effects",
    "Finish",
    RUNNING,
    EXPERT,
];
/// Heading in the help of options that do not change the picture.
const RUNNING: &str = "Running";
/// Heading in the help of options for researchers, which `-h` leaves out.
const EXPERT: &str = "Expert";

/// Sorts the options of a command by the order of their headings.
pub fn arrange(command: Command) -> Command {
    let mut options: Vec<Arg> = command.get_arguments().cloned().map(with_common_settings).collect();
    options.sort_by_key(|option| {
        option.get_help_heading().map(|heading| HEADINGS.iter().position(|known| *known == heading))
    });
    let arranged = Command::new(command.get_name().to_string())
        .aliases(command.get_all_aliases().map(String::from).collect::<Vec<_>>())
        .next_line_help(command.is_next_line_help_set())
        .args(options)
        .groups(command.get_groups().cloned());
    let arranged = match command.get_about() {
        Some(about) => arranged.about(about.clone()),
        None => arranged,
    };
    match command.get_long_about() {
        Some(about) => arranged.long_about(about.clone()),
        None => arranged,
    }
}

/// Sets what every option has: `-h` leaves out options for experts, and a negative number is a value.
fn with_common_settings(option: Arg) -> Arg {
    let is_long = option.get_help_heading() == Some(EXPERT) || option.is_hide_short_help_set();
    let option = option.hide_short_help(is_long);
    let has_value = !option.is_positional() && option.get_action().takes_values();
    if has_value { option.allow_negative_numbers(true) } else { option }
}

/// Adds the help option to a command, as the last before the options for experts.
pub fn with_help(command: Command) -> Command {
    let long = command.get_arguments().any(|option| option.is_hide_short_help_set());
    let about = if long { "Print help: -h what you need first, --help everything" } else { "Print help" };
    let help = Arg::new("help").short('h').long("help").action(ArgAction::Help).help(about).display_order(usize::MAX);
    let runs = command.get_arguments().any(|option| option.get_help_heading() == Some(RUNNING));
    command.disable_help_flag(true).arg(help.help_heading(runs.then_some(RUNNING)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::command_line;

    #[test]
    fn all_headings_are_known() {
        command_line().debug_assert();
        for command in command_line().get_subcommands() {
            for heading in command.get_arguments().filter_map(Arg::get_help_heading) {
                assert!(HEADINGS.contains(&heading), "{heading} of {}", command.get_name());
            }
        }
    }
}
