//! Reads the description of a model's interface from its library: the inverse of
//! [`Interface::to_json`](pilotage_sdk::Interface::to_json).

use pilotage_sdk::structure::{Dependency, Structure, Unknown};
use pilotage_sdk::{Interface, Role, Unit, Variable};
use serde_json::Value;

/// Parses the interface in a library's text.
///
/// # Errors
/// If it is no valid interface; the message is for the user.
pub fn read(text: &str) -> Result<Interface, String> {
    let json = serde_json::from_str(text).unwrap_or_default();
    interface(&json).ok_or_else(|| match json["panic"].as_str() {
        Some(message) => format!("the model panics: {message}"),
        None => "what it says cannot be read; use the same release of pilotage for both".to_owned(),
    })
}

fn interface(json: &Value) -> Option<Interface> {
    let list = |name: &str| json[name].as_array();
    // In format 1, value references began at 0.
    if json["format"] != 2 {
        return None;
    }
    let unknowns = |name| list(name)?.iter().map(unknown).collect::<Option<Vec<_>>>();
    let interface = Interface {
        name: string(&json["name"])?,
        description: string(&json["description"])?,
        guid: string(&json["guid"])?,
        variables: list("variables")?
            .iter()
            .map(variable)
            .collect::<Option<_>>()?,
        states: list("states")?.iter().map(number).collect::<Option<_>>()?,
        structure: Structure {
            outputs: unknowns("outputs")?,
            derivatives: unknowns("derivatives")?,
            indicators: unknowns("indicators")?,
            initial: unknowns("initial")?,
        },
    };
    is_consistent(&interface).then_some(interface)
}

/// Whether all indices refer to variables.
fn is_consistent(interface: &Interface) -> bool {
    let s = &interface.structure;
    let unknowns = [&s.outputs, &s.derivatives, &s.indicators, &s.initial];
    let indices = unknowns
        .into_iter()
        .flatten()
        .flat_map(|u| std::iter::once(u.index).chain(u.dependencies.iter().map(|d| d.index)))
        .chain(interface.states.iter().copied());
    let n = interface.variables.len();
    s.derivatives.len() == interface.states.len() && indices.into_iter().all(|index| index < n)
}

fn string(json: &Value) -> Option<String> {
    json.as_str().map(str::to_owned)
}

fn number(json: &Value) -> Option<usize> {
    json.as_u64().and_then(|n| usize::try_from(n).ok())
}

fn variable(json: &Value) -> Option<Variable> {
    let role = json["role"].as_str()?;
    let (role, _) = Role::NAMES.into_iter().find(|(_, name)| *name == role)?;
    let name = string(&json["unit"])?;
    Some(Variable {
        name: string(&json["name"])?,
        unit: Unit::parse(&name)?,
        role,
        start: json["start"].as_f64(),
        min: json["min"].as_f64(),
        max: json["max"].as_f64(),
        nominal: json["nominal"].as_f64(),
        description: string(&json["description"])?,
    })
}

fn unknown(json: &Value) -> Option<Unknown> {
    let indices = json["dependencies"].as_array()?;
    let constants = json["constant"].as_array()?;
    let dependencies = indices.iter().zip(constants).map(|(index, constant)| {
        Some(Dependency {
            index: number(index)?,
            constant: constant.as_bool()?,
        })
    });
    Some(Unknown {
        index: number(&json["index"])?,
        dependencies: dependencies.collect::<Option<_>>()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::{Model, Quadcopter, pilot::PAPER_THETA};

    #[test]
    fn interfaces_read_back_as_they_were_written() {
        for model in [
            Model::pilot(&PAPER_THETA, 1.0),
            Model::quadcopter(&Quadcopter::default()),
        ] {
            let interface = Interface::of(&model);
            assert_eq!(read(&interface.to_json()), Ok(interface));
        }
    }

    #[test]
    fn other_text_is_refused() {
        let error = read(r#"{"panic": "unit furlong"}"#).unwrap_err();
        assert_eq!(error, "the model panics: unit furlong");
        let text = Interface::of(&Model::pilot(&PAPER_THETA, 1.0)).to_json();
        for (from, to) in [
            ("\"format\": 2", "\"format\": 1"),
            ("\"index\": 2", "\"index\": 99"),
            ("\"unit\": \"m\"", "\"unit\": \"furlong\""),
            ("{", ""),
        ] {
            assert!(text.contains(from), "{from}");
            let error = read(&text.replacen(from, to, 1)).unwrap_err();
            assert!(error.starts_with("what it says cannot be read"), "{from}");
        }
    }
}
