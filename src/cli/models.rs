//! `pilotage models`: lists the built-in pilots and vehicles.

use super::model::open;
use super::{Failure, Outcome, terminal};
use crate::models::library::{self, Kind};
use clap::Subcommand;
use serde_json::{Value, json};

/// Arguments of `pilotage models`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    pilotage models\n  \
    pilotage models show crossover > my_pilot.toml     start your own model from it\n  \
    pilotage models show linear --order 4\n\n\
    Names of built-in models can be used in place of model files: `pilotage model check hess`, \
    `pilotage export crossover -o crossover.fmu`, `pilotage cosim pilot=crossover vehicle=integrator ...`.")]
pub struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Subcommand)]
enum Command {
    /// Print the model file of a built-in model.
    Show {
        /// Its name.
        name: String,
        /// Order of a model that has one.
        #[arg(long)]
        order: Option<usize>,
    },
}

/// Runs the command.
pub fn run(args: Args) -> Result<Outcome, Failure> {
    let text = match args.command {
        Some(Command::Show { name, order }) => open::text(open::built_in(&name)?, order)?,
        None if args.json => format!("{:#}\n", to_json()),
        None => list(),
    };
    terminal::print(&text)?;
    Ok(Outcome::Done)
}

fn list() -> String {
    let names = library::all().iter().map(|model| model.name.len());
    let width = names.max().unwrap_or_default();
    let mut text = String::new();
    let kinds = [
        (Kind::Pilot, "Pilots"),
        (Kind::Vehicle, "Vehicles"),
        (Kind::Helicopter, "Helicopters, for `pilotage hv`"),
    ];
    for (kind, title) in kinds {
        text += &format!("{title}\n");
        for model in library::all().iter().filter(|model| model.kind == kind) {
            let order = if model.has_order { " (--order N)" } else { "" };
            text += &format!("  {:width$}  {}{order}\n", model.name, model.about());
        }
    }
    text + "\n`pilotage models show NAME` prints a file, to begin one's own from it.\n"
}

fn to_json() -> Value {
    let all = library::all().iter();
    let all = all.map(|model| {
        json!({
            "name": model.name,
            "kind": match model.kind {
                Kind::Pilot => "pilot",
                Kind::Vehicle => "vehicle",
                Kind::Helicopter => "helicopter",
            },
            "description": model.about(),
            "has_order": model.has_order,
        })
    });
    json!({ "models": all.collect::<Vec<_>>() })
}
